"""One Zenoh session on the event loop, shared by the links of many robots; closed in bounded time."""

from __future__ import annotations

import asyncio
import logging
import threading
from collections.abc import Awaitable, Callable, Sequence

import zenoh
from zenoh.handlers import Callback

from common.clock import monotonic_ns
from common.errors import LinkError
from common.link.declared import Declarations
from common.link.inbox import Inbox, wake
from common.link.link import Link, Overheard
from common.link.presence import watch_operators, watch_presence
from common.link.roster import MOST_ROBOTS, Roster
from common.link.waiting import count_peers, paths_in_words
from common.metrics.link import TopicCounters
from common.wire.instance import draw_instance
from common.wire.presence import ROBOT_NAME, OperatorPresence, ProcessPresence, place
from common.wire.topics import SUMMARY, Topic
from common.wire.version import installed

CLOSE_TIMEOUT_S = 1.0
REPLACED_S = 0.1
"""For a session that leads nowhere while another is open: its closing may last as long as its attempts."""
REOPEN_S = 0.5
"""Between two attempts to open the session anew."""
OpenAgain = Callable[[frozenset[str]], Awaitable[zenoh.Session]]
"""Opens a session as the first one, whose rules refuse these common names."""

_Place = tuple[str, str, str, str]
"""Of a link: the other session, where it begins and ends, whether it is reliable."""

log = logging.getLogger(__name__)


def check_robot_name(robot: str) -> None:
    """Raises LinkError for a name that is no part of a key."""
    if not ROBOT_NAME.fullmatch(robot):
        raise LinkError(f"robot {robot!r}: expected a name of at most 64 letters, digits, '_', '.' and '-'")


class LinkSession:
    """One Zenoh session. `link(robot)` gives the topics of a robot; all links end with the session."""

    def __init__(
        self,
        session: zenoh.Session,
        loop: asyncio.AbstractEventLoop,
        quality: Callable[[Topic], Topic] = lambda topic: topic,
        revoked: frozenset[str] = frozenset(),
    ) -> None:
        """`revoked`: common names that the session's access rules refuse."""
        self._quality = quality
        self._declared = Declarations(session)
        self.refused = revoked
        """Common names that this session's rules refuse."""
        self.revoked = revoked
        """Common names that are revoked now."""
        self._on_revoked: list[Callable[[frozenset[str]], None]] = []
        self._loop = loop
        self._links: dict[str, Link] = {}
        self._closed = False
        self._moving = asyncio.Lock()
        """Held by who puts another Zenoh session in the place of this one."""
        self.overheard: Overheard | None = None
        """Told of each message of the links that are made from now on."""

    def link(self, robot: str) -> Link:
        """The link of that robot, the same one each time. Raises LinkError for a name that is none."""
        check_robot_name(robot)
        if robot not in self._links:
            self._links[robot] = Link(self._declared, robot, self._loop, self._quality, self.overheard)
        return self._links[robot]

    def watch_presence(self, on_change: Callable[[ProcessPresence, bool], None], robot: str = "*") -> None:
        """Call `on_change(presence, alive)` on the loop as processes come and go, of every robot's name."""
        watch_presence(self._declared, self._loop, robot, on_change)

    def drop(self, robot: str) -> None:
        """Close the link of that robot and withdraw all that it declared; `link` makes a new one."""
        link = self._links.pop(robot, None)
        if link is not None:
            link.withdraw()

    def watch_roster(self, roster: Roster) -> None:
        """Keep a roster of the robots and operators that are there, wherever routers lead."""
        watch_presence(
            self._declared, self._loop, "*", lambda one, here: roster.on_presence(one, here, monotonic_ns())
        )
        watch_operators(self._declared, self._loop, roster.on_operator)
        key = SUMMARY.key_for("*")
        inbox = Inbox(key, roster.on_summary, self._loop, TopicCounters(), most_keys=MOST_ROBOTS)

        def declare(session: zenoh.Session) -> object:
            on_this = self._declared.only_of(session, inbox.on_sample)
            return session.declare_subscriber(key, Callback(on_this, indirect=False))

        self._declared.add(declare)

    def declare_operator(self, operator: str, endpoints: Sequence[str]) -> None:
        """Show that this operator's master lives, until the session closes or dies."""
        presence = OperatorPresence(operator, draw_instance(), installed("tandem"), place(endpoints))
        self._declared.add(lambda s: s.liveliness().declare_token(presence.key))

    def watch_peers(self, on_change: Callable[[str, str, bool], None]) -> None:
        """Call `on_change(session_id, name, connected)` on the loop, for those already there at once.

        `name` is the common name of the certificate; empty where the transport has none.
        """
        names: dict[_Place, str] = {}
        """Of each link: the event of its end does not name it. Zenoh may tell twice that one came."""

        def on_event(event: zenoh.LinkEvent) -> None:
            place, here = _place_of(event.link), event.kind == zenoh.SampleKind.PUT
            if here == (place in names):
                return
            if here:
                names[place] = event.link.auth_identifier or ""
            name = names[place] if here else names.pop(place)
            wake(self._loop, on_change, place[0], name, here)

        def declare(session: zenoh.Session) -> object:
            for (session_id, *_), name in names.items():
                wake(self._loop, on_change, session_id, name, False)
            names.clear()
            on_this = self._declared.only_of(session, on_event)
            return session.info.declare_link_events_listener(Callback(on_this, indirect=False), history=True)

        self._declared.add(declare)

    def watch_revoked(self, on_change: Callable[[frozenset[str]], None]) -> None:
        """Call `on_change(names)` on the loop with the revoked common names, now and whenever they change."""
        self._on_revoked.append(on_change)
        on_change(self.revoked)

    def revoke(self, names: frozenset[str]) -> None:
        """Tell who watches that these names are revoked, and no others."""
        self.revoked = names
        for on_change in self._on_revoked:
            on_change(names)

    async def reopen(self, open_again: OpenAgain) -> None:
        """Close the session, which cuts all that are connected, and open one whose rules refuse the revoked.

        It ends when the new session is open: what is published until then is lost, questions fail.
        """
        async with self._moving:
            refused = self.revoked
            await self._close_in_time(CLOSE_TIMEOUT_S)
            while True:
                try:
                    self._declared.move(await open_again(refused))
                except (LinkError, zenoh.ZError) as error:
                    log.warning("the link is closed: %s; trying again", error)
                    await asyncio.sleep(REOPEN_S)
                else:
                    self.refused = refused
                    return

    async def replace(
        self, opened: zenoh.Session, refused: frozenset[str], needed: Callable[[], bool] = lambda: True
    ) -> bool:
        """Go on in a session that is open already and refuses these names; the former one is closed first.

        False, and the new one is closed, where it is not `needed` any more.
        """
        before = self._declared.session
        async with self._moving:
            if self._closed or self._declared.session is not before or not needed():
                await self._close_in_time(CLOSE_TIMEOUT_S, opened)
                return False
            await self._close_in_time(REPLACED_S)
            self._declared.move(opened)
            self.refused = refused
            return True

    @property
    def paths(self) -> str:
        """Of two paths, which one does not carry and why; empty where both do, or where there is one."""
        return "" if self._closed else paths_in_words(self._declared.session)

    @property
    def peers(self) -> int:
        """How many sessions this one is connected to now."""
        return 0 if self._closed else count_peers(self._declared.session)

    async def close(self, timeout_s: float = CLOSE_TIMEOUT_S) -> bool:
        """Close the session; False if it did not close in time, and was left to itself.

        Off the loop, in a daemon thread: on a link that leads nowhere it can take ten seconds.
        """
        if self._closed:
            return True
        self._closed = True
        for link in self._links.values():
            link.close()
        return await self._close_in_time(timeout_s)

    async def _close_in_time(self, timeout_s: float, session: zenoh.Session | None = None) -> bool:
        """Close a session, by itself the one that is in use."""
        closed: asyncio.Future[None] = self._loop.create_future()
        ended = session or self._declared.session
        threading.Thread(
            target=self._close_session, args=(ended, closed), name="link-close", daemon=True
        ).start()
        done, _ = await asyncio.wait({closed}, timeout=timeout_s)
        if not done:
            log.warning("the Zenoh session did not close within %g s; it is left to itself", timeout_s)
        return bool(done)

    def _close_session(self, session: zenoh.Session, closed: asyncio.Future[None]) -> None:
        try:
            session.close()
        except Exception as error:  # a link that leads nowhere: nothing to be done about it now
            log.debug("error while closing the session: %s", error)
        wake(self._loop, _settle, closed)


def _place_of(link: zenoh.Link) -> _Place:
    # quic-datagram has two links between the same two places
    return str(link.zid), str(link.src), str(link.dst), str(link.reliability)


def _settle(closed: asyncio.Future[None]) -> None:
    if not closed.done():
        closed.set_result(None)
