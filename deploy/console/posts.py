"""What pages post: log-in, acts, the study's steps and answers, and the stop."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping

from aiohttp import web

from common.clock import monotonic_ns
from common.link import LinkSession
from common.wire.messages import Action
from deploy.client.destination import Destination
from deploy.console.acts import MARK, MOVES, ActRefusedError, carry_out, may_act, read_act, read_mark
from deploy.console.hub import Hub
from deploy.console.replies import Visitors, answer, body_of, error_answer
from deploy.console.session import SESSION_S, Person

STOP_PATH = "/api/stop"
NOT_KEPT = "the stop is asked for, but nobody would go on with it if this console died"

log = logging.getLogger(__name__)


class PostHandlers:
    """The handlers of posts."""

    def __init__(
        self,
        hub: Hub,
        visitors: Visitors,
        where: Destination,
        session: LinkSession | None,
        on_login: Callable[[Person], None],
        secure: bool,
    ) -> None:
        self._hub = hub
        self._visitors = visitors
        self._where = where
        self._session = session
        self._on_login = on_login
        self._secure = secure

    def routes(self) -> list[web.RouteDef]:
        """Path by path."""
        return [
            web.post("/api/login", self._log_in),
            web.post("/api/logout", self._log_out),
            web.post("/api/act", self._act),
            web.post("/api/study", self._study),
            web.post("/api/calibrate", self._calibrate),
            web.post(STOP_PATH, self._stop),
        ]

    async def _log_in(self, request: web.Request) -> web.StreamResponse:
        body = await body_of(request)
        token = body.get("token")
        found = self._hub.access.log_in(token, monotonic_ns()) if isinstance(token, str) else None
        if found is None:
            self._hub.access.count_refusal("token")
            log.warning("refused: a log-in with a wrong, used or old token")
            return error_answer(
                403, "this token is wrong, old or used already: take the newest from the console's log"
            )
        secret, person = found
        log.warning("logged in: %s as %s", person.name, person.role)
        self._on_login(person)
        response = answer({"role": person.role.value, "person": person.name})
        response.set_cookie(
            self._visitors.cookie,
            secret,
            max_age=int(SESSION_S),
            httponly=True,
            samesite="Strict",
            secure=self._secure,
            path="/",
        )
        return response

    async def _log_out(self, request: web.Request) -> web.StreamResponse:
        secret, _ = self._visitors.of(request)
        self._hub.access.log_out(secret)
        self._hub.refresh(monotonic_ns())
        response = answer({})
        response.del_cookie(self._visitors.cookie, path="/")
        return response

    async def _act(self, request: web.Request) -> web.StreamResponse:
        body = await body_of(request)
        if body.get("act") == Action.ESTOP.value:
            return self._stopped(request, body)
        secret, person = self._visitors.of(request)
        if body.get("act") == MARK:
            robot, text = read_mark(body, self._hub.robots, person)
            words = self._hub.desk.mark(text)
            self._hub.models[robot].events.add(MARK, f"{person.name}: {text}", monotonic_ns())
            return answer({"done": True, "text": words, "guard": ""})
        act = read_act(body, self._hub.robots, person, self._lists)
        if act.action in MOVES and self._hub.calibration.under_way:
            raise ActRefusedError(409, "the suit is being calibrated: end that first")
        if self._session is None:
            return error_answer(503, "there is no link to the robot")
        log.warning("%s: %s asks for %s", act.robot, person.name, act.action)
        said = await carry_out(act, self._session.link(act.robot), self._where)
        model = self._hub.models.get(act.robot)
        if model is not None:
            model.events.add("act", f"{person.name}: {act.action}: {said.text}", monotonic_ns())
        if said.done and act.action is Action.ENGAGE:
            self._hub.engaged[act.robot] = secret
        elif said.done and act.action is Action.DISENGAGE:
            self._hub.engaged.pop(act.robot, None)
        return answer({"done": said.done, "text": said.text, "guard": said.guard})

    def _lists(self, robot: str) -> bool:
        opened = self._hub.opened
        return opened is not None and opened.lists(robot)

    async def _study(self, request: web.Request) -> web.StreamResponse:
        body = await body_of(request)
        may_act(self._visitors.of(request)[1])
        return answer({"done": True, "text": self._hub.desk.act(body)})

    async def _calibrate(self, request: web.Request) -> web.StreamResponse:
        body = await body_of(request)
        person = self._visitors.of(request)[1]
        may_act(person)
        words = await self._hub.calibration.act(body, self._hub.engaged_robots)
        log.warning("%s: calibration: %s: %s", person.name, body.get("do"), words)
        return answer({"done": True, "text": words})

    async def _stop(self, request: web.Request) -> web.StreamResponse:
        return self._stopped(request, await body_of(request))

    def _stopped(self, request: web.Request, body: Mapping[str, object]) -> web.StreamResponse:
        robot = body.get("robot") or self._hub.robots[0]
        stopper = self._hub.stopper(robot) if isinstance(robot, str) else None
        if stopper is None:
            return error_answer(400, f"no such robot here: expected one of {', '.join(self._hub.robots)}")
        _, person = self._visitors.of(request)
        shown = stopper.stop(f"console: {person.name or person.role}")
        if not shown.kept and shown.robot_ns is None:
            # it is asked all the same; the page asks again until the robot has acknowledged it
            return error_answer(503, f"{NOT_KEPT}: use the switch at the robot")
        return answer({"id": shown.number}, status=202)
