"""The console's URLs: the page's files, the WebSocket, log-in and acts. aiohttp, and nothing that decides."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Awaitable, Callable, Mapping

from aiohttp import web

from common.clock import monotonic_ns, to_ms
from common.errors import TandemError
from common.link import LinkSession
from common.log.throttle import LogThrottle
from deploy.client.destination import Destination
from deploy.console.acts import ActRefusedError
from deploy.console.files import PageFiles
from deploy.console.hub import Hub
from deploy.console.page_socket import LONGEST, PageSockets
from deploy.console.persons import Persons
from deploy.console.posts import STOP_PATH, PostHandlers
from deploy.console.replies import HEADERS, Visitors, answer, error_answer
from deploy.console.reports import POLICY as REPORT_POLICY
from deploy.console.session import Person, RateLimit
from deploy.console.study import questionnaires
from deploy.console.viewers import REQUESTS_PER_S

PAGES = {
    "/": "index.html", "/engineer": "engineer.html", "/study": "study.html", "/calibrate": "calibrate.html",
    "/code": "code.html",
}  # fmt: skip
"""The last is a screen for a real camera to look at: it shows the time of this host as codes."""
READS_PER_S = 200.0
"""Files and sockets a second, and as many at once, for one client; a page has some twenty files."""
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
        persons: Persons | None = None,
    ) -> None:
        """`session`: to the robots; None without a link. `setup`: what `/api/setup` says of a robot."""
        self._hub = hub
        self._setup = setup
        self._visitors = Visitors(hub.access, port, persons or Persons({}, ""))
        self._posts = PostHandlers(hub, self._visitors, where, session, on_login, secure)
        self._files = files or PageFiles()
        self._throttle = LogThrottle()
        self._reports: asyncio.Future[list[dict[str, str]]] | None = None
        """A walk through the folder of reports that is under way."""
        self._rates: dict[tuple[str, float], RateLimit] = {}

    def make(self) -> web.Application:
        """The application."""
        app = web.Application(client_max_size=LONGEST, middlewares=[self._guarded])
        for path in PAGES:
            app.router.add_get(path, self._page)
        for folder in ("page", "vendor"):
            app.router.add_get(f"/{folder}/{{name:.+}}", self._named_file)
        app.router.add_get("/api/setup", self._get_setup)
        app.router.add_get("/api/clock", self._clock)
        app.router.add_get("/api/questionnaires", self._questionnaires)
        app.router.add_get("/api/reports", self._list_reports)
        app.router.add_get("/reports/{name:.+}", self._report)
        app.router.add_get("/ws", PageSockets(self._hub, self._visitors).serve)
        app.router.add_routes(self._posts.routes())
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
            return error_answer(403, words)
        limit = REQUESTS_PER_S if request.method == "POST" else READS_PER_S
        # all that share an address share its limit: what others send must not take the stop away
        if request.path != STOP_PATH and not self._passes(request, limit):
            access.count_refusal("rate")
            return error_answer(429, f"more than {limit:g} requests a second")
        try:
            response = await handler(request)
        except web.HTTPRequestEntityTooLarge:
            access.count_refusal("size")
            response = error_answer(413, f"more than {LONGEST} bytes")
        except web.HTTPException as error:
            response = error_answer(error.status, error.reason)
        except TandemError as error:
            response = error_answer(409, str(error))
        except ActRefusedError as error:
            access.count_refusal("role" if error.status in (401, 403) else "form")
            response = error_answer(error.status, str(error))
        if not response.prepared:
            for name, value in HEADERS.items():
                response.headers.setdefault(name, value)
        return response

    def _passes(self, request: web.Request, limit: float) -> bool:
        client = request.remote or "", limit
        while len(self._rates) >= _CLIENTS and client not in self._rates:
            self._rates.pop(next(iter(self._rates)))
        return self._rates.setdefault(client, RateLimit(limit)).passes(monotonic_ns())

    async def _page(self, request: web.Request) -> web.StreamResponse:
        return self._file(request, "page", PAGES[request.path])

    async def _clock(self, request: web.Request) -> web.StreamResponse:
        """The clock of this host: a page takes half of the way there and back as the bound."""
        return answer({"here_ms": to_ms(monotonic_ns())})

    async def _questionnaires(self, request: web.Request) -> web.StreamResponse:
        self._must_see(request)
        return answer(questionnaires())

    async def _list_reports(self, request: web.Request) -> web.StreamResponse:
        self._must_see(request)
        if self._reports is None:  # all who ask meanwhile get the answer of one walk
            self._reports = asyncio.ensure_future(asyncio.to_thread(self._hub.reports.listed))
            self._reports.add_done_callback(self._walked)
        return answer({"reports": await asyncio.shield(self._reports)})

    def _walked(self, _: object) -> None:
        self._reports = None

    async def _report(self, request: web.Request) -> web.StreamResponse:
        self._must_see(request)
        file = await asyncio.to_thread(self._hub.reports.find, request.match_info["name"])
        if file is None:
            return error_answer(404, "no such report")
        headers = {**HEADERS, "Content-Security-Policy": REPORT_POLICY, "Cache-Control": "no-cache"}
        return web.Response(body=file.body, content_type=file.content_type, headers=headers)

    def _must_see(self, request: web.Request) -> None:
        if not self._visitors.of(request)[1].role.sees:
            raise ActRefusedError(401, "log in first: this page shows a patient's home")

    async def _named_file(self, request: web.Request) -> web.StreamResponse:
        return self._file(request, request.path.split("/")[1], request.match_info["name"])

    def _file(self, request: web.Request, folder: str, name: str) -> web.StreamResponse:
        file = self._files.find(folder, name)
        if file is None:
            return error_answer(404, "no such page")
        headers = {"ETag": f'"{file.etag}"', "Cache-Control": "no-cache", "Vary": "Accept-Encoding"}
        if file.etag in request.headers.get("If-None-Match", ""):
            return web.Response(status=304, headers=headers)
        body = file.plain
        if file.gzipped is not None and "gzip" in request.headers.get("Accept-Encoding", ""):
            headers["Content-Encoding"], body = "gzip", file.gzipped
        return web.Response(body=body, content_type=file.content_type, charset="utf-8", headers=headers)

    async def _get_setup(self, request: web.Request) -> web.StreamResponse:
        self._must_see(request)
        robot = request.query.get("robot", self._hub.robots[0])
        if robot not in self._hub.models:
            return error_answer(404, f"no such robot here: expected one of {', '.join(self._hub.robots)}")
        return answer({**self._setup(robot), "robots": list(self._hub.robots), "robot": robot})
