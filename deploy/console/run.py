"""The console's process: its link, its tap, its pages, until it is stopped."""

from __future__ import annotations

import asyncio
import logging
import socket
import ssl
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from aiohttp import web

from common.clock import monotonic_ns
from common.config.console import ConsoleConfig
from common.errors import TandemError
from common.link import LinkSession, open_session
from common.link.roster import Roster
from common.process.runtime import until_stopped
from common.skeleton import Skeleton
from common.wire.version import software
from deploy.client.destination import Destination
from deploy.console.app import ConsoleApp
from deploy.console.backup import StopBackup
from deploy.console.calibration import CalibrationDesk, CalibrationPlace
from deploy.console.deadman import DeadmanRelay
from deploy.console.hearing import Hearing
from deploy.console.hub import VIEW_HZ, Hub, person_of, stranger
from deploy.console.keyframes import KeyframeRequests
from deploy.console.model.guard_table import STATES, TRANSITIONS
from deploy.console.model.pictures import STALE_S
from deploy.console.model.robot import SILENT_S, RobotModel, Side, Whose
from deploy.console.model.scene import scene
from deploy.console.opened import OpenedRobots
from deploy.console.outbox import WINDOW
from deploy.console.persons import Persons
from deploy.console.reports import ReportFolder
from deploy.console.session import TOKEN_S, Access, PageRole, Person
from deploy.console.stopping import RobotStopper
from deploy.console.study import StudyDesk

FIRST_S = 0.5
"""Between two looks for a robot to begin with."""

log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class ConsoleOptions:
    """What the command line and the files say."""

    where: Destination
    skeleton: Skeleton
    config: ConsoleConfig
    side: Side = Side.ELSEWHERE
    tap: Path | None = None
    """The tap of master or slave on this host; None: everything is heard over the link."""
    deadman: str | None = None
    """The source of the operator's deadman; None: not known."""
    deadman_socket: Path | None = None
    """Where the master hears a deadman that a page holds."""
    zones: Sequence[Mapping[str, object]] | None = None
    """The robot's zones; None: not known here."""
    recordings: Path | None = None
    """`[recording] folder` of this host: where marks go while no session is under way."""
    calibration: CalibrationPlace | None = None
    """Where the operator's suit can be calibrated; None: not from this console."""
    on_ready: Callable[[str], None] = field(default=lambda line: None)
    """Takes each line for the person who started it: addresses with their tokens."""


async def run_console(options: ConsoleOptions, stop: asyncio.Event) -> None:
    """Serve until `stop` is set. Raises TandemError where address, keys or link do not allow it."""
    tls = _tls(options.config)
    with _listener(options.config) as listener:
        await until_stopped(stop, _run(options, _Door(listener, tls)))


@dataclass(frozen=True, slots=True)
class _Door:
    """Where browsers come in."""

    listener: socket.socket
    tls: ssl.SSLContext | None


async def _run(options: ConsoleOptions, door: _Door) -> None:
    where = options.where
    whose = Whose(where.operator, options.side)
    models = {robot: RobotModel(robot, options.skeleton, whose) for robot in where.robots}
    async with open_session(where.link) as session:
        hearing = Hearing(models)
        # the robot's own tap has its figures; the master's has those of the master alone
        if options.side is not Side.ROBOT or options.tap is None:
            hearing.listen(session, states=options.tap is None)
        backup = StopBackup(where.link, where.operator)
        backup.start()

        def stopper_of(model: RobotModel) -> RobotStopper:
            return RobotStopper(session.link(model.robot), model, where.operator, backup)

        def make(robot: str) -> tuple[RobotModel, RobotStopper]:
            model = RobotModel(robot, options.skeleton, whose)
            return model, stopper_of(model)

        stoppers = {robot: stopper_of(model) for robot, model in models.items()}
        for stopper in stoppers.values():
            stopper.watch()
        roster = Roster()
        session.watch_roster(roster)
        opened = OpenedRobots(
            roster, hearing, stoppers,
            session=session, profile=options.skeleton.name, operator=where.operator, make=make,
        )  # fmt: skip
        if not models:
            await _first(opened)
        relay = DeadmanRelay(options.deadman_socket) if options.deadman_socket else None
        try:
            async with asyncio.TaskGroup() as tasks:
                if options.tap is not None:
                    tasks.create_task(hearing.read_tap(options.tap))
                    tasks.create_task(hearing.stand_in(where.link))
                tasks.create_task(backup.watch())
                await _serve(options, door, session, hearing, stoppers, relay, opened)
        finally:
            for stopper in stoppers.values():
                await stopper.close()
            backup.close()
            if relay is not None:
                relay.close()


async def _serve(
    options: ConsoleOptions,
    door: _Door,
    session: LinkSession,
    hearing: Hearing,
    stoppers: Mapping[str, RobotStopper],
    relay: DeadmanRelay | None,
    opened: OpenedRobots,
) -> None:
    config = options.config
    tls = door.tls
    port = door.listener.getsockname()[1]
    access = Access(_names(config, port), tls is not None, stranger(config.on_this_host_only))
    models = hearing.models
    hub = Hub(models, access, stoppers, relay, losing_page_stops=config.losing_page == "stop")
    hub.opened = opened
    hub.desk = StudyDesk(config.study, options.recordings)
    hub.reports = ReportFolder(config.reports)
    hub.calibrates(CalibrationDesk(options.calibration))
    hearing.on_picture = hub.on_picture
    keyframes = KeyframeRequests(session)
    hub.put_key, opened.on_close = keyframes.put, keyframes.forget
    address = f"{'https' if tls else 'http'}://{_shown_host(config)}:{port}/"

    persons = Persons(config.persons, options.where.operator)

    def revoke(names: frozenset[str]) -> None:
        for secret in persons.revoke(names):
            access.log_out(secret)
        hub.refresh(monotonic_ns())

    session.watch_revoked(revoke)

    def offer(person: Person) -> None:
        token = access.issue(person, monotonic_ns())
        page = "engineer" if person.role is PageRole.ENGINEER else ""
        options.on_ready(f"{person.role}: {address}{page}#token={token}")

    app = ConsoleApp(
        hub,
        options.where,
        session,
        lambda robot: _setup(options),
        secure=tls is not None,
        port=port,
        on_login=offer,
        persons=persons,
    )
    runner = web.AppRunner(app.make(), access_log=None, shutdown_timeout=1.0, handle_signals=False)
    await runner.setup()
    try:
        await web.SockSite(runner, door.listener, ssl_context=tls).start()
        options.on_ready(f"console: {address} (without a token it only shows, and stops)")
        async with asyncio.TaskGroup() as tasks:
            tasks.create_task(_offer_again(offer, options.where.operator))
            await hub.show()
    finally:
        await hub.calibration.close()
        await runner.cleanup()


async def _first(opened: OpenedRobots) -> None:
    """Open a robot, where the file names none: one that waits for an operator, or the first of the list."""
    log.info("waiting for a robot to show itself")
    while True:
        await asyncio.sleep(FIRST_S)
        for row in opened.rows(monotonic_ns()).robots:
            if not opened.open(row.robot):
                return


async def _offer_again(offer: Callable[[Person], None], operator: str) -> None:
    """Offer tokens now, and new ones as often as they grow too old, until cancelled."""
    while True:
        for role in (PageRole.OPERATOR, PageRole.ENGINEER):
            offer(person_of(role, operator if role is PageRole.OPERATOR else ""))
        await asyncio.sleep(TOKEN_S)


def _setup(options: ConsoleOptions) -> dict[str, object]:
    config = options.config
    return {
        "version": 1,
        "tandem": software().tandem,
        "operator": options.where.operator,
        "side": options.side.value,
        "language": config.language,
        "hardware_estop": config.hardware_estop,
        "deadman": options.deadman,
        "losing_page_stops": config.losing_page == "stop",
        "guard_states": list(STATES),
        "transitions": list(TRANSITIONS),
        "deadman_key": config.deadman_key,
        "stale_picture_s": STALE_S,
        "silent_s": SILENT_S,
        "rate_hz": VIEW_HZ,
        "window": WINDOW,
        "calibrates": options.calibration is not None,
        "zones": list(options.zones or ()),
        "zones_known": options.zones is not None,
        **scene(options.skeleton),
    }


def _names(config: ConsoleConfig, port: int) -> list[str]:
    names = [config.host, *config.names]
    if config.on_this_host_only:
        names += ["localhost", "127.0.0.1", "::1"]
    hosts = [f"[{name}]" if ":" in name else name for name in dict.fromkeys(names)]
    # browsers leave out the port that is the scheme's own
    return [f"{host}:{port}" for host in hosts] + (hosts if port in (80, 443) else [])


def _shown_host(config: ConsoleConfig) -> str:
    if config.host in ("0.0.0.0", "::") and config.names:
        return config.names[0]
    return f"[{config.host}]" if ":" in config.host else config.host


def _listener(config: ConsoleConfig) -> socket.socket:
    family = socket.AF_INET6 if ":" in config.host else socket.AF_INET
    listener = socket.socket(family, socket.SOCK_STREAM)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((config.host, config.port))
        listener.listen(64)
    except OSError as error:
        listener.close()
        raise TandemError(
            f"{config.listen}: the console cannot listen there ({error.strerror}); name another address by "
            "--listen or [console] listen"
        ) from None
    listener.setblocking(False)
    return listener


def _tls(config: ConsoleConfig) -> ssl.SSLContext | None:
    if config.certificate is None:
        return None
    context = ssl.create_default_context(ssl.Purpose.CLIENT_AUTH)
    context.minimum_version = ssl.TLSVersion.TLSv1_2
    if config.authority is not None:
        context.verify_mode = ssl.CERT_OPTIONAL
        try:
            context.load_verify_locations(config.authority)
        except (OSError, ssl.SSLError) as error:
            raise TandemError(f"{config.authority}: no authority's certificate ({error})") from None
    key = config.certificate.with_suffix(".key")
    try:
        context.load_cert_chain(config.certificate, key)
    except (OSError, ssl.SSLError) as error:
        raise TandemError(
            f"{config.certificate}: no HTTPS with it and {key.name} ({error}); `tandem keys make` makes them"
        ) from None
    return context
