"""One Zenoh session on the event loop, shared by the links of many robots; closed in bounded time."""

from __future__ import annotations

import asyncio
import logging
import math
import re
import threading
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from functools import partial

import zenoh
from zenoh.handlers import Callback

from common.errors import LinkError
from common.link.certificates import check_keys
from common.link.config import LinkConfig
from common.link.congestion import check_congestion_control, set_congestion_control
from common.link.inbox import wake
from common.link.link import Link
from common.link.opening import open_zenoh
from common.link.presence import watch_presence
from common.link.waiting import count_peers
from common.wire.presence import ProcessPresence
from common.wire.topics import Topic

CLOSE_TIMEOUT_S = 1.0
_ROBOT_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,63}")

log = logging.getLogger(__name__)


@asynccontextmanager
async def open_session(
    config: LinkConfig,
    mode: str = "",
    router_within_s: float = math.inf,
    waits: Callable[[str], None] = lambda _: None,
) -> AsyncIterator[LinkSession]:
    """A session for any robots' links. Raises LinkError where it cannot be opened; a peer may come later.

    `mode`: `router`, in place of the configuration's own. `router_within_s`: how long it waits for a router,
    or for an address to listen at; a robot waits for ever, a command does not. `waits` takes, now and then,
    the reason for which it waits.
    """
    if not (config.listen or config.connect):
        raise LinkError("the link has no endpoint: set `listen` or `connect` under [link]")
    check_keys(config)
    algorithm = config.tcp_congestion_control
    if algorithm is not None:
        check_congestion_control(algorithm)
    opened = await open_zenoh(config, mode, router_within_s, waits)
    session = LinkSession(opened, asyncio.get_running_loop(), config.quality)
    if algorithm is not None:
        set_congestion_control(algorithm)  # what the listening sockets accept inherits it
        session.watch_peers(partial(_choose_congestion, algorithm))
    try:
        yield session
    finally:
        await session.close()


def _choose_congestion(algorithm: str, *_: object) -> None:
    set_congestion_control(algorithm)


@asynccontextmanager
async def open_link(config: LinkConfig, robot: str) -> AsyncIterator[Link]:
    """A session for one robot alone. Raises LinkError where it cannot be opened; a peer may come later."""
    check_robot_name(robot)
    async with open_session(config) as session:
        yield session.link(robot)


def check_robot_name(robot: str) -> None:
    """Raises LinkError for a name that is no part of a key."""
    if not _ROBOT_NAME.fullmatch(robot):
        raise LinkError(f"robot {robot!r}: expected a name of at most 64 letters, digits, '_', '.' and '-'")


class LinkSession:
    """One Zenoh session. `link(robot)` gives the topics of a robot; all links end with the session."""

    def __init__(
        self,
        session: zenoh.Session,
        loop: asyncio.AbstractEventLoop,
        quality: Callable[[Topic], Topic] = lambda topic: topic,
    ) -> None:
        self._quality = quality
        self._session = session
        self._loop = loop
        self._links: dict[str, Link] = {}
        self._held: list[object] = []
        self._closed = False

    def link(self, robot: str) -> Link:
        """The link of that robot, the same one each time. Raises LinkError for a name that is none."""
        check_robot_name(robot)
        if robot not in self._links:
            self._links[robot] = Link(self._session, robot, self._loop, self._quality)
        return self._links[robot]

    def watch_presence(self, on_change: Callable[[ProcessPresence, bool], None], robot: str = "*") -> None:
        """Call `on_change(presence, alive)` on the loop as processes come and go, of every robot's name."""
        watch_presence(self._session, self._loop, robot, on_change, self._held)

    def watch_peers(self, on_change: Callable[[str, str, bool], None]) -> None:
        """Call `on_change(session_id, name, connected)` on the loop, for those already there at once.

        `name` is the common name of the certificate; empty where the transport has none.
        """
        names: dict[str, list[str]] = {}
        """Of each connected session, once a link: the event of its end does not name it."""

        def on_event(event: zenoh.LinkEvent) -> None:
            session_id, here = str(event.link.zid), event.kind == zenoh.SampleKind.PUT
            if here:
                name = event.link.auth_identifier or ""
                names.setdefault(session_id, []).append(name)
            else:
                links = names.get(session_id, [""])
                name = links.pop()
                if not links:
                    names.pop(session_id, None)
            wake(self._loop, on_change, session_id, name, here)

        self._held.append(
            self._session.info.declare_link_events_listener(Callback(on_event, indirect=False), history=True)
        )

    @property
    def peers(self) -> int:
        """How many sessions this one is connected to now."""
        return 0 if self._closed else count_peers(self._session)

    async def close(self, timeout_s: float = CLOSE_TIMEOUT_S) -> bool:
        """Close the session; False if it did not close in time, and was left to itself.

        Off the loop, in a daemon thread: on a link that leads nowhere it can take ten seconds.
        """
        if self._closed:
            return True
        self._closed = True
        for link in self._links.values():
            link.close()
        closed: asyncio.Future[None] = self._loop.create_future()
        threading.Thread(target=self._close_session, args=(closed,), name="link-close", daemon=True).start()
        done, _ = await asyncio.wait({closed}, timeout=timeout_s)
        if not done:
            log.warning("the Zenoh session did not close within %g s; the process ends without it", timeout_s)
        return bool(done)

    def _close_session(self, closed: asyncio.Future[None]) -> None:
        try:
            self._session.close()
        except Exception as error:  # a link that leads nowhere: nothing to be done about it now
            log.debug("error while closing the session: %s", error)
        wake(self._loop, _settle, closed)


def _settle(closed: asyncio.Future[None]) -> None:
    if not closed.done():
        closed.set_result(None)
