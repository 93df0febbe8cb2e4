"""The console's URLs: the page's files, the WebSocket, log-in and acts. aiohttp, and nothing that decides."""

from __future__ import annotations

import asyncio
import json
import logging
from collections.abc import Awaitable, Callable, Mapping
from contextlib import suppress

from aiohttp import WSCloseCode, WSMsgType, web

from common.clock import monotonic_ns, to_ms
from common.link import LinkSession
from common.log.throttle import LogThrottle
from common.wire.messages import Action
from deploy.client.destination import Destination
from deploy.console.acts import MARK, ActRefusedError, carry_out, read_act, read_mark
from deploy.console.files import PageFiles
from deploy.console.hub import Hub, as_json
from deploy.console.session import SESSION_S, Person, RateLimit
from deploy.console.viewers import REQUESTS_PER_S, OpenPage, pack

COOKIE = "tandem_console"
"""Cookies know no ports: the port is added, or two consoles on one host would log each other out."""
STOP_PATH = "/api/stop"
NOT_KEPT = "the stop is asked for, but nobody would go on with it if this console died"
LONGEST = 4096
"""Bytes of a message or a body."""
READS_PER_S = 200.0
"""Files and sockets a second, and as many at once, for one client; a page has some twenty files."""
STILL_S = 10.0
"""A socket is asked for a sign of life so often; a process that stands still is closed after half as long."""
POLICY = (
    "default-src 'self'; img-src 'self' blob:; style-src 'self'; connect-src 'self'; worker-src 'self'; "
    "frame-ancestors 'none'; base-uri 'none'; form-action 'none'; object-src 'none'"
)
HEADERS = {
    "Content-Security-Policy": POLICY,
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Permissions-Policy": "camera=(), geolocation=(), microphone=()",
}
_CLIENTS = 256
Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]

log = logging.getLogger(__name__)


class ConsoleApp:
    """The handlers."""

    def __init__(
        self,
        hub: Hub,
        where: Destination,
        session: LinkSession | None,
        setup: Callable[[str], Mapping[str, object]],
        *,
        secure: bool = False,
        port: int = 0,
        on_login: Callable[[Person], None] = lambda _: None,
        files: PageFiles | None = None,
    ) -> None:
        """`session`: to the robots; None without a link. `setup`: what `/api/setup` says of a robot."""
        self._hub = hub
        self._where = where
        self._session = session
        self._setup = setup
        self._secure = secure
        self._cookie = f"{COOKIE}_{port}"
        self._on_login = on_login
        self._files = files or PageFiles()
        self._robots = tuple(hub.models)
        self._throttle = LogThrottle()
        self._rates: dict[tuple[str, float], RateLimit] = {}

    def make(self) -> web.Application:
        """The application."""
        app = web.Application(client_max_size=LONGEST, middlewares=[self._guarded])
        app.router.add_get("/", self._nurse)
        app.router.add_get("/engineer", self._engineer)
        for folder in ("page", "vendor"):
            app.router.add_get(f"/{folder}/{{name:.+}}", self._named_file)
        app.router.add_get("/code", self._code)
        app.router.add_get("/api/setup", self._get_setup)
        app.router.add_get("/api/clock", self._clock)
        app.router.add_get("/ws", self._socket)
        app.router.add_post("/api/login", self._log_in)
        app.router.add_post("/api/logout", self._log_out)
        app.router.add_post("/api/act", self._act)
        app.router.add_post(STOP_PATH, self._stop)
        return app

    @web.middleware
    async def _guarded(self, request: web.Request, handler: Handler) -> web.StreamResponse:
        """Refuse foreign hosts and origins, floods and long bodies; name each refusal in words."""
        access = self._hub.access
        words = access.wrong_host(request.host)
        if not words and (request.method != "GET" or request.path == "/ws"):
            words = access.wrong_origin(request.headers.get("Origin", ""), request.host)
        if words:
            if self._throttle.passes(monotonic_ns()):
                log.warning("refused %s %r: %s", request.method, request.path, words)
            return _error(403, words)
        limit = REQUESTS_PER_S if request.method == "POST" else READS_PER_S
        # all that share an address share its limit: what others send must not take the stop away
        if request.path != STOP_PATH and not self._passes(request, limit):
            access.count_refusal("rate")
            return _error(429, f"more than {limit:g} requests a second")
        try:
            response = await handler(request)
        except web.HTTPRequestEntityTooLarge:
            access.count_refusal("size")
            response = _error(413, f"more than {LONGEST} bytes")
        except web.HTTPException as error:
            response = _error(error.status, error.reason)
        except ActRefusedError as error:
            access.count_refusal("role" if error.status in (401, 403) else "form")
            response = _error(error.status, str(error))
        if not response.prepared:
            response.headers.update(HEADERS)
        return response

    def _passes(self, request: web.Request, limit: float) -> bool:
        client = request.remote or "", limit
        while len(self._rates) >= _CLIENTS and client not in self._rates:
            self._rates.pop(next(iter(self._rates)))
        return self._rates.setdefault(client, RateLimit(limit)).passes(monotonic_ns())

    async def _nurse(self, request: web.Request) -> web.StreamResponse:
        return self._file(request, "page", "index.html")

    async def _engineer(self, request: web.Request) -> web.StreamResponse:
        return self._file(request, "page", "engineer.html")

    async def _code(self, request: web.Request) -> web.StreamResponse:
        """A screen for a real camera to look at: it shows the time of this host as codes."""
        return self._file(request, "page", "code.html")

    async def _clock(self, request: web.Request) -> web.StreamResponse:
        """The clock of this host: a page takes half of the way there and back as the bound."""
        return _answer({"here_ms": to_ms(monotonic_ns())})

    async def _named_file(self, request: web.Request) -> web.StreamResponse:
        return self._file(request, request.path.split("/")[1], request.match_info["name"])

    def _file(self, request: web.Request, folder: str, name: str) -> web.StreamResponse:
        file = self._files.find(folder, name)
        if file is None:
            return _error(404, "no such page")
        headers = {"ETag": f'"{file.etag}"', "Cache-Control": "no-cache", "Vary": "Accept-Encoding"}
        if file.etag in request.headers.get("If-None-Match", ""):
            return web.Response(status=304, headers=headers)
        body = file.plain
        if file.gzipped is not None and "gzip" in request.headers.get("Accept-Encoding", ""):
            headers["Content-Encoding"], body = "gzip", file.gzipped
        return web.Response(body=body, content_type=file.content_type, charset="utf-8", headers=headers)

    async def _get_setup(self, request: web.Request) -> web.StreamResponse:
        if not self._person(request)[1].role.sees:
            return _error(401, "log in first: this page shows a patient's home")
        robot = request.query.get("robot", self._robots[0])
        if robot not in self._hub.models:
            return _error(404, f"no such robot here: expected one of {', '.join(self._robots)}")
        return _answer({**self._setup(robot), "robots": list(self._robots), "robot": robot})

    async def _log_in(self, request: web.Request) -> web.StreamResponse:
        body = await _body(request)
        token = body.get("token")
        found = self._hub.access.log_in(token, monotonic_ns()) if isinstance(token, str) else None
        if found is None:
            self._hub.access.count_refusal("token")
            log.warning("refused: a log-in with a wrong, used or old token")
            return _error(
                403, "this token is wrong, old or used already: take the newest from the console's log"
            )
        secret, person = found
        log.warning("logged in: %s as %s", person.name, person.role)
        self._on_login(person)
        response = _answer({"role": person.role.value, "person": person.name})
        response.set_cookie(
            self._cookie,
            secret,
            max_age=int(SESSION_S),
            httponly=True,
            samesite="Strict",
            secure=self._secure,
            path="/",
        )
        return response

    async def _log_out(self, request: web.Request) -> web.StreamResponse:
        secret, _ = self._person(request)
        self._hub.access.log_out(secret)
        self._hub.refresh(monotonic_ns())
        response = _answer({})
        response.del_cookie(self._cookie, path="/")
        return response

    async def _act(self, request: web.Request) -> web.StreamResponse:
        body = await _body(request)
        if body.get("act") == Action.ESTOP.value:
            return self._stopped(request, body)
        secret, person = self._person(request)
        if body.get("act") == MARK:
            robot, text = read_mark(body, self._robots, person)
            self._hub.models[robot].events.add(MARK, f"{person.name}: {text}", monotonic_ns())
            return _answer({"done": True, "text": "noted on every page of this console", "guard": ""})
        act = read_act(body, self._robots, person)
        if self._session is None:
            return _error(503, "there is no link to the robot")
        log.warning("%s: %s asks for %s", act.robot, person.name, act.action)
        answer = await carry_out(act, self._session.link(act.robot), self._where)
        model = self._hub.models[act.robot]
        model.events.add("act", f"{person.name}: {act.action}: {answer.text}", monotonic_ns())
        if answer.done and act.action is Action.ENGAGE:
            self._hub.engaged[act.robot] = secret
        elif answer.done and act.action is Action.DISENGAGE:
            self._hub.engaged.pop(act.robot, None)
        return _answer({"done": answer.done, "text": answer.text, "guard": answer.guard})

    async def _stop(self, request: web.Request) -> web.StreamResponse:
        return self._stopped(request, await _body(request))

    def _stopped(self, request: web.Request, body: Mapping[str, object]) -> web.StreamResponse:
        robot = body.get("robot") or self._robots[0]
        if not isinstance(robot, str) or robot not in self._hub.stoppers:
            return _error(400, f"no such robot here: expected one of {', '.join(self._robots)}")
        _, person = self._person(request)
        shown = self._hub.stoppers[robot].stop(f"console: {person.name or person.role}")
        if not shown.kept and shown.robot_ns is None:
            # it is asked all the same; the page asks again until the robot has acknowledged it
            return _error(503, f"{NOT_KEPT}: use the switch at the robot")
        return _answer({"id": shown.number}, status=202)

    def _person(self, request: web.Request) -> tuple[str, Person]:
        secret = request.cookies.get(self._cookie, "")
        return secret, self._hub.access.person(secret, monotonic_ns())

    async def _socket(self, request: web.Request) -> web.StreamResponse:
        socket = web.WebSocketResponse(max_msg_size=LONGEST, heartbeat=STILL_S, compress=False)
        await socket.prepare(request)
        secret, person = self._person(request)
        if self._hub.full(person):
            self._hub.access.count_refusal("viewers")
            why = f"{len(self._hub.pages)} pages are open already"
            await socket.send_str(pack({"kind": "bye", "why": why}))
            await socket.close(code=WSCloseCode.TRY_AGAIN_LATER)
            return socket
        robot = request.query.get("robot", "")
        model = self._hub.models.get(robot, self._hub.models[self._robots[0]])
        page = OpenPage(socket, model, secret, person)
        self._hub.enter(page)
        writing = asyncio.create_task(page.write())
        try:
            why = await self._listen(socket, page)
            if why:
                log.warning("page of %s closed: %s", page.name, why)
                with suppress(ConnectionError):
                    await asyncio.wait_for(socket.send_str(pack({"kind": "bye", "why": why})), 1.0)
                await socket.close(code=WSCloseCode.POLICY_VIOLATION)
        finally:
            self._hub.leave(page)
            writing.cancel()
            await asyncio.gather(writing, return_exceptions=True)
        return socket

    async def _listen(self, socket: web.WebSocketResponse, page: OpenPage) -> str:
        """Take the page's messages until it goes; why it is closed, where this side does."""
        access = self._hub.access
        async for message in socket:
            if message.type is WSMsgType.ERROR:
                access.count_refusal("size" if message.data.code == WSCloseCode.MESSAGE_TOO_BIG else "form")
                break
            now_ns = monotonic_ns()
            body = _parsed(message.data) if message.type is WSMsgType.TEXT else None
            kind = None if body is None else body.get("kind")
            if body is not None and kind == "stop":  # before any limit
                self._request(page, kind, body.get("robot") or page.model.robot)
            if not page.messages.passes(now_ns):
                access.count_refusal("rate")
                return "too many messages"
            if body is None:
                access.count_refusal("form")
                return "a message that is no JSON object"
            if kind == "ack":
                page.acknowledge(body.get("n"))
            elif kind == "held":
                words = self._hub.held(page, body.get("down") is True, body.get("n"))
                if words:
                    page.say({"kind": "answer", "to": "held", "done": False, "text": words})
            elif kind != "stop" and not page.requests.passes(now_ns):
                access.count_refusal("rate")
                return f"more than {REQUESTS_PER_S:g} requests a second"
            elif kind == "shown":
                page.saw_code(body, now_ns)
            elif kind == "keyframe" and isinstance(camera := body.get("camera"), str):
                self._hub.ask_for_key(page.model.robot, camera)
            elif kind != "stop":
                self._request(page, kind, body.get("robot", page.model.robot))
        return ""

    def _request(self, page: OpenPage, kind: object, robot: object) -> None:
        known = isinstance(robot, str) and robot in self._hub.models
        if not known:
            text = f"no such robot here: expected one of {', '.join(self._robots)}"
            page.say({"kind": "answer", "to": str(kind)[:20], "done": False, "text": text})
        elif kind == "stop":
            page.asked_stop |= robot == page.model.robot
            shown = self._hub.stoppers[str(robot)].stop(f"console: {page.name}")
            sure = shown.kept or shown.robot_ns is not None
            text = "asked" if sure else NOT_KEPT
            page.say({"kind": "answer", "to": "stop", "done": sure, "text": text, "id": shown.number})
        elif kind == "robot":
            page.turn_to(self._hub.models[str(robot)])
            self._hub.greet(page)
        else:
            page.say({"kind": "answer", "to": str(kind)[:20], "done": False, "text": "no such message"})


def _parsed(text: str) -> dict[str, object] | None:
    try:
        body = json.loads(text)
    except (ValueError, RecursionError):
        return None
    return body if isinstance(body, dict) else None


async def _body(request: web.Request) -> dict[str, object]:
    """A post's JSON object. Raises ActRefusedError."""
    if request.content_type != "application/json":
        raise ActRefusedError(415, "expected Content-Type application/json")
    body = _parsed(await request.text())
    if body is None:
        raise ActRefusedError(400, "expected a JSON object")
    return body


def _answer(value: object, status: int = 200) -> web.Response:
    return web.Response(
        text=as_json(value),
        status=status,
        content_type="application/json",
        headers={"Cache-Control": "no-store"},
    )


def _error(status: int, words: str) -> web.Response:
    response = _answer({"error": words}, status)
    response.headers.update(HEADERS)
    return response
