"""The console's middle: models, open pages, and the clock that shows the ones to the others."""

from __future__ import annotations

import json
import logging
import secrets
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial

import psutil

from common.clock import monotonic_ns, to_ns
from common.metrics.tree import to_tree
from common.process.pacing import TickGrid
from common.process.ticker import ticks
from common.wire.video import JPEG, VideoFrame
from deploy.console.calibration import CalibrationDesk
from deploy.console.deadman import DeadmanRelay
from deploy.console.model.guard_table import ENGAGED
from deploy.console.model.robot import RobotModel
from deploy.console.opened import OpenedRobots
from deploy.console.reports import ReportFolder
from deploy.console.session import Access, PageRole, Person, RateLimit
from deploy.console.stopping import RobotStopper
from deploy.console.study import StudyDesk
from deploy.console.transcode import JpegStreams
from deploy.console.viewers import KEPT, LOST_S, MOST, OpenPage, pack

VIEW_HZ = 25
FACTS_EVERY = VIEW_HZ
BEAT_S = 0.3
"""A page that holds the deadman and says nothing for so long does not hold it any more."""
KEYS_PER_S = 1.0
SEEN_S = 0.5
"""A beat of the deadman from a page that has seen nothing newer does not hold."""

MOST_LISTED = 100
"""Robots in the page's list; who waits for an operator comes first."""

log = logging.getLogger(__name__)


@dataclass(eq=False)
class Hub:
    """What all handlers share."""

    models: Mapping[str, RobotModel]
    access: Access
    stoppers: Mapping[str, RobotStopper]
    deadman: DeadmanRelay | None = None
    losing_page_stops: bool = False
    desk: StudyDesk = field(default_factory=StudyDesk)
    reports: ReportFolder = field(default_factory=ReportFolder)
    calibration: CalibrationDesk = field(default_factory=CalibrationDesk)
    jpeg: JpegStreams = field(default_factory=JpegStreams)
    """For pages that cannot decode H.264."""
    opened: OpenedRobots | None = None
    """The list of all robots that are there, of which a page may open others; None: there is no list."""
    pages: list[OpenPage] = field(default_factory=list)
    session: str = field(default_factory=lambda: secrets.token_hex(4))
    """Another one with each process."""
    put_key: Callable[[str, str], None] = lambda robot, camera: None
    """Asks a robot's camera for a picture that stands alone."""
    engaged: dict[str, str] = field(default_factory=dict)
    """By robot, the log-in of the page that engaged it."""
    _key_rates: dict[tuple[str, str], RateLimit] = field(default_factory=dict)
    _gone_ns: dict[str, int] = field(default_factory=dict)
    _lapsed: set[str] = field(default_factory=set)
    """Log-ins of pages that were lost while they held: where they come back, they must let go first."""
    _process: psutil.Process = field(default_factory=psutil.Process)

    @property
    def robots(self) -> tuple[str, ...]:
        """The robots that pages can show now, the file's own first."""
        return tuple(self.models)

    @property
    def engaged_robots(self) -> list[str]:
        """Robots that follow an operator or move to their posture, as far as was heard."""
        heard = [robot for robot, model in self.models.items() if model.guard in ENGAGED]
        listed = [] if self.opened is None else self.opened.engaged(monotonic_ns())
        return list(dict.fromkeys([*heard, *listed]))

    def calibrates(self, desk: CalibrationDesk) -> None:
        """Show what this desk shows."""
        self.calibration = desk
        desk.on_shown = self._show_calibration

    def turn(self, page: OpenPage, robot: str) -> str:
        """Let a page show another robot, opened if need be; why not, else empty."""
        why = self.find(robot, page.person)
        if not why:
            page.turn_to(self.models[robot])
            self.greet(page)
        return why

    def find(self, robot: str, person: Person) -> str:
        """Why this person cannot be shown a robot; empty: it is open, opened if need be."""
        if robot in self.models:
            return ""
        if self.opened is not None and person.role.sees:
            return self.opened.open(robot)
        return f"no such robot here: expected one of {', '.join(self.robots)}"

    def stopper(self, robot: str) -> RobotStopper | None:
        """Of a robot that is open or listed: one that was closed while a page was away is opened anew."""
        if robot not in self.stoppers and self.opened is not None:
            self.opened.open(robot, to_stop=True)
        return self.stoppers.get(robot)

    def full(self, person: Person) -> bool:
        """Whether one more page, of this person, would be too many."""
        return len(self.pages) >= MOST + KEPT * person.role.acts

    def enter(self, page: OpenPage) -> None:
        """A page opened."""
        page.lapsed = page.secret in self._lapsed
        self._lapsed.discard(page.secret)
        self.pages.append(page)
        self.greet(page)
        log.info("page opened: %s sees %s (%d open)", page.name, page.model.robot, len(self.pages))

    def leave(self, page: OpenPage) -> None:
        """A page closed: what it held is released."""
        self.pages.remove(page)
        if page.holds or page.lapsed:
            self._lapsed.add(page.secret)
        self.release(page)
        log.info("page closed: %s (%d open)", page.name, len(self.pages))

    def greet(self, page: OpenPage) -> None:
        """Tell a page who it is taken for."""
        role = page.person.role
        for camera in page.model.pictures.newest:
            self.ask_for_key(page.model.robot, camera)
        page.say({
            "kind": "hello",
            "role": role.value,
            "person": page.person.name,
            "robot": page.model.robot,
            "viewers": len(self.pages),
            "session": self.session,
            "may": {
                "stop": True,
                "act": role.acts,
                "reset": role.acts,
                "hold": role.acts and self.deadman is not None,
            },
        })  # fmt: skip
        if self.calibration.shown is not None:
            page.show("calibration", pack(self.calibration.shown), {})

    def on_picture(self, model: RobotModel, camera: str) -> None:
        """A newer picture came."""
        frame = model.pictures.newest[camera].frame
        pages = [page for page in self.pages if page.model is model]
        jpeg = [page for page in pages if page.wants_jpeg and frame.codec != JPEG]
        shown = [page.show_picture(camera, frame) for page in pages if page not in jpeg]
        if not all(shown):
            self.ask_for_key(model.robot, camera)
        key = model.robot, camera
        if any(page.person.role.sees for page in jpeg):
            show = partial(self._show_jpeg, model, camera)
            self.jpeg.offer(key, frame, show, partial(self.ask_for_key, *key))
        else:
            self.jpeg.drop(key)

    def _show_jpeg(self, model: RobotModel, camera: str, frame: VideoFrame) -> None:
        for page in self.pages:
            if page.model is model and page.wants_jpeg:
                page.show_picture(camera, frame)

    def want_jpeg(self, page: OpenPage) -> str:
        """The page cannot decode H.264; why this console cannot help, else empty."""
        page.wants_jpeg = not self.jpeg.why_not()
        return self.jpeg.why_not()

    def ask_for_key(self, robot: str, camera: str) -> None:
        """A page needs a picture of H.264 that stands alone. Asked seldom: it costs all who receive it."""
        newest = self.models[robot].pictures.newest.get(camera)
        if newest is None or newest.frame.codec == JPEG:
            return
        if self._key_rates.setdefault((robot, camera), RateLimit(KEYS_PER_S)).passes(monotonic_ns()):
            self.put_key(robot, camera)

    async def show(self) -> None:
        """Show every page its robot until cancelled."""
        async for due in ticks(TickGrid(monotonic_ns(), round(1e9 / VIEW_HZ))):
            now_ns = monotonic_ns()
            watched = (
                {page.model.robot for page in self.pages} if due.tick % FACTS_EVERY else set(self.models)
            )
            for robot in watched:
                self._show_view(self.models[robot], now_ns)
            if due.tick % FACTS_EVERY == 0:
                self.refresh(now_ns)
                for model in list(self.models.values()):
                    self._show_facts(model, now_ns)
                await self._list_robots(now_ns)
            self._watch_pages(now_ns)
            self._watch_deadman(now_ns)
            if self.calibration.under_way:
                self.calibration.watch(self.engaged_robots)
            for page in self.pages:
                page.tell_stop(now_ns)

    def held(self, page: OpenPage, down: bool, number: object) -> str:
        """A beat of the deadman from a page; the words where it does not count, else empty."""
        if self.deadman is None:
            return "this console is not the operator's deadman: [operator.deadman] names another source"
        if not self.access.person(page.secret, monotonic_ns()).role.acts:
            return "log in first: only an operator's page can hold the deadman"
        if not down:
            self.release(page)
            page.lapsed = False
            return ""
        if self._silent(page, monotonic_ns()):
            self._lapse(page)
        if page.lapsed:
            return "the page fell silent while it held: release, then press again"
        if any(other.holds for other in self.pages if other is not page):
            return "another page holds the deadman"
        if not page.saw_lately(number, SEEN_S):
            return "this page shows an old state, so it does not hold"
        page.holds, page.beat_ns = True, monotonic_ns()
        self.deadman.beat(True)
        return ""

    def release(self, page: OpenPage) -> None:
        """The page holds nothing any more."""
        if page.holds and self.deadman is not None:
            self.deadman.beat(False)
        page.holds = False

    def refresh(self, now_ns: int) -> None:
        """Take the role from pages whose log-in has ended, by a person or by its age, and tell them."""
        for page in self.pages:
            person = self.access.person(page.secret, now_ns)
            if person != page.person:
                page.person = person
                self.greet(page)

    def _show_view(self, model: RobotModel, now_ns: int) -> None:
        body = pack(model.view(now_ns))
        holder = next((page for page in self.pages if page.holds), None)
        for page in self.pages:
            if page.model is model:
                held_by = "" if holder is None else "this page" if holder is page else holder.name
                page.show("view", body, {"page_ms": page.outbox.page_ms, "holder": held_by})

    def _show_facts(self, model: RobotModel, now_ns: int) -> None:
        if not any(page.model is model for page in self.pages):
            return
        body = pack({**model.facts(now_ns), "console": self._figures(), "study": self.desk.shown(now_ns)})
        for page in self.pages:
            if page.model is model:
                viewers = [
                    {"person": other.name, "robot": other.model.robot, "this": other is page}
                    for other in self.pages
                ]
                page.show("facts", body, {"viewers": viewers, "glass": page.glass.shown(now_ns)})

    def _show_calibration(self) -> None:
        if self.calibration.shown is not None:
            body = pack(self.calibration.shown)
            for page in self.pages:
                page.show("calibration", body, {})

    async def _list_robots(self, now_ns: int) -> None:
        """Show who is there, and close what no page shows."""
        if self.opened is None:
            return
        await self.opened.close_unseen({page.model.robot for page in self.pages} | set(self.engaged), now_ns)
        if self.pages:
            rows = self.opened.rows(now_ns)
            shown = replace(rows, robots=rows.robots[:MOST_LISTED])
            body = pack({**to_tree(shown), "there": len(rows.robots)})
            for page in self.pages:
                page.show("fleet", body, {})

    def _watch_deadman(self, now_ns: int) -> None:
        """A page that fell silent holds no more; while none holds, the master is told so again and again."""
        if self.deadman is None:
            return
        for page in self.pages:
            if self._silent(page, now_ns):
                self._lapse(page)
        if not any(page.holds for page in self.pages):
            self.deadman.beat(False)

    @staticmethod
    def _silent(page: OpenPage, now_ns: int) -> bool:
        return page.holds and now_ns - page.beat_ns > to_ns(BEAT_S)

    def _lapse(self, page: OpenPage) -> None:
        page.lapsed = True
        self.release(page)

    def _figures(self) -> dict[str, object]:
        return {
            "cpu_percent": round(self._process.cpu_percent(), 1),
            "rss_mb": round(self._process.memory_info().rss / 1e6, 1),
            "skipped": sum(page.outbox.replaced for page in self.pages),
            "refused": self.access.refused,
        }

    def _watch_pages(self, now_ns: int) -> None:
        """Where it is configured so, the loss of the page that engaged a robot stops it."""
        for robot, secret in list(self.engaged.items()):
            lives = any(page.secret == secret and not _lost(page, now_ns) for page in self.pages)
            if lives:
                self._gone_ns.pop(robot, None)
                continue
            gone_ns = self._gone_ns.setdefault(robot, now_ns)
            if self.losing_page_stops and now_ns - gone_ns > to_ns(LOST_S):
                del self.engaged[robot]
                self._gone_ns.pop(robot, None)
                if self.models[robot].guard in ENGAGED:
                    self.stoppers[robot].stop("the page that engaged the robot was lost")


def _lost(page: OpenPage, now_ns: int) -> bool:
    since_ns = page.outbox.owes_since_ns()
    return since_ns is not None and now_ns - since_ns > to_ns(LOST_S)


def stranger(on_this_host_only: bool) -> PageRole:
    """What a page without a log-in may: beyond this host it sees nothing, for it shows a patient's home."""
    return PageRole.VIEWER if on_this_host_only else PageRole.NOBODY


def as_json(value: object) -> str:
    """For answers to requests."""
    return json.dumps(value, allow_nan=False, ensure_ascii=False)


def person_of(role: PageRole, operator: str) -> Person:
    """Who logs in with a token of a role."""
    return Person(role, operator or role.value)
