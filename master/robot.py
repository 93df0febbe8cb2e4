"""One commanded robot: its lease, clock and topics. Robots share none of this."""

from __future__ import annotations

import asyncio
import logging
import secrets
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace

from common.clock import monotonic_ns, to_ns
from common.clock_sync import MasterExchange
from common.errors import CodecError, LinkError
from common.link import Link
from common.log.throttle import LogThrottle
from common.metrics.master import CommandedMetrics, LeaseHeld, MasterMetrics, RobotHeard
from common.process.pacing import TickGrid
from common.process.ticker import coarse_ticks
from common.wire.codec import decode, encode
from common.wire.instance import draw_instance
from common.wire.messages import ClockReply, ControlReply, StateHead, Statistics
from common.wire.presence import ProcessPresence
from common.wire.topics import CLOCK, COMMAND, CONTROL, IN_ORDER, LOST, STATE, STATISTICS, keyframe, video
from master.alarms.situation import RobotSign
from master.comfort.scaling import MotionScaling
from master.deadman.grip import Grip
from master.homonyms import Homonyms
from master.joint_angles.sample import JointAngleSample
from master.lease import LeaseKeeper
from master.picture import CamerasWatch
from master.pipeline import CommandWriter
from master.robot_watch import RobotWatch
from master.watched import TakenRobot

ENGAGED = ("align", "track", "clutch")
WAITS_S, HELD_S = 0.05, 0.1
"""Between two looks at the lease: while it is not held, and while it is."""
CLOCK_SETTLED, CLOCK_EASY = 40, 2
"""After so many questions the clock of a robot that does not move is asked at every second turn only."""
CLOCK_QUICK = 3
"""Questions that follow at once on the first answer of a process. The guard trusts a clock that it has
measured three times, each time by the question after an answer: at the usual rate that takes 0.7 s."""
MOVES_S = 5.0
"""A robot that followed when it was heard last counts as following for so long."""

log = logging.getLogger(__name__)


def asks_clock(turn: int, moves: bool) -> bool:
    """Whether the robot's clock is asked at this turn: its measurement costs as much as eight states."""
    return moves or turn <= CLOCK_SETTLED or turn % CLOCK_EASY == 0


class CommandedRobot:
    """Sends one robot the operator's postures, keeps its lease and measures its clock."""

    def __init__(
        self,
        name: str,
        operator: str,
        joints: int,
        *,
        link: Link,
        endpoints: Sequence[str] = (),
        scaling: MotionScaling | None = None,
        may_claim: Callable[[int, int], bool] = lambda now_ns, lost_ns: True,
        tapped: bool = False,
    ) -> None:
        """`endpoints`: where this master is reached; shown where two masters have the same operator.

        `tapped`: what is heard is handed to a tap, and its recordings need the robot's own figures too.

        `may_claim(now_ns, lost_ns)`: whether the lease may be claimed now; `lost_ns`: when it was lost last.
        """
        self._may_claim = may_claim
        self.name = name
        self._instance = draw_instance()
        self._endpoints = endpoints
        self._joints = joints
        self._link = link
        asker = 1 + secrets.randbelow((1 << 63) - 1)
        self._scaling = scaling
        self._writer = CommandWriter(name, scaling)
        self._control = CONTROL.of(operator)
        self._last_claim = ""
        self.clock = MasterExchange(asker)
        self._lease = LeaseKeeper(name, operator, asker)
        self._watch = RobotWatch()
        self._homonyms = Homonyms(name, operator)
        self._clock_of = -1
        """Which process of that name answered a question of the clock last; -1: none."""
        self._undecodable = 0
        self._unread, self._unread_ns = "", 0
        self._throttle = LogThrottle()
        self._put_command: Callable[[bytes], None] = link.publish(COMMAND.of(operator))
        self._put_statistics: Callable[[bytes], None] = link.publish(STATISTICS)
        self._put_keyframe: dict[str, Callable[[bytes], None]] = {}
        self.video = CamerasWatch()
        link.subscribe(STATE, self._on_state)
        if tapped:
            link.subscribe(STATISTICS, lambda *_: None)  # the tap overhears it; the master makes no use of it
        link.subscribe_keys(video("*"), self.video.on_payload, in_order=IN_ORDER)
        link.watch_presence(self._on_presence)

    async def run(self) -> None:
        """Keep the lease and the clock until cancelled."""
        self._link.declare_alive("master", self._instance, self._endpoints)
        async with asyncio.TaskGroup() as tasks:
            tasks.create_task(self._keep_lease())
            tasks.create_task(self._keep_clock())

    def send(self, angles: JointAngleSample, grip: Grip, angles_ns: int, beside: str = "") -> None:
        """Put the posture on this robot's topic. It never blocks.

        `beside`: what speaks against moving this robot too (`common.wire.together`).
        """
        if beside and not angles.doubt:
            angles = replace(angles, doubt=beside)
        seen = self.video.seen_by(angles.sampled_ns)
        command = self._writer.write(angles, self._lease.token, grip, angles_ns, monotonic_ns(), seen)
        self._put_command(encode(command))
        for camera in self.video.asks_for_key(monotonic_ns()):
            self._ask_for_key(camera)

    def _ask_for_key(self, camera: str) -> None:
        if camera not in self._put_keyframe:
            self._put_keyframe[camera] = self._link.publish(keyframe(camera))
        self._put_keyframe[camera](LOST)

    def publish_metrics(self, now_ns: int, shared: MasterMetrics) -> None:
        """Publish what the master counted, with what it counted of this robot alone."""
        own = replace(self.metrics(), round_trip_recent_us=self._watch.round_trip.take_recent())
        self._put_statistics(encode(Statistics(now_ns, replace(shared, robots={self.name: own}))))

    def _on_state(self, payload: bytes, arrived_ns: int) -> None:
        try:
            state = decode(payload, StateHead, self._joints)
        except CodecError as error:
            self._undecodable += 1
            self._unread, self._unread_ns = str(error), arrived_ns
            if self._throttle.passes(arrived_ns):
                log.warning("%s: a state cannot be read: %s (%d so far)", self.name, error, self._undecodable)
            return
        self._homonyms.on_state(state.instance, arrived_ns)
        two = self._homonyms.words(arrived_ns) is not None
        if two and self._lease.token and state.instance != self._lease.instance:
            return  # from another robot of that name: it says nothing of the robot that this master commands
        self._lease.on_state(state, arrived_ns)
        if self._scaling is not None:
            # what the robot follows under another's lease is not this operator
            self._scaling.on_state(state.guard if self._lease.holds(state) else "", state.resting)
        self._watch.on_state(state, arrived_ns, ours=self._lease.holds(state))

    async def _keep_lease(self) -> None:
        while True:
            await asyncio.sleep(HELD_S if self._lease.token else WAITS_S)
            change = self._watch.change(monotonic_ns())
            if change:
                log.warning("%s: %s", self.name, change)
            if await self._two_answer(monotonic_ns()):
                continue
            now_ns = monotonic_ns()
            if self._watch.silent(now_ns) or not self._may_claim(now_ns, self._lease.lost_ns):
                continue
            request = self._lease.request(now_ns)
            if request is None:
                continue
            try:
                reply = decode(await self._link.ask(self._control, encode(request)), ControlReply)
            except (LinkError, CodecError) as error:
                self._log_claim(str(error))
                continue
            self._lease.on_reply(reply, monotonic_ns())
            self._log_claim(reply.text)

    def _log_claim(self, answer: str) -> None:
        """A master that waits for the lease claims four times a second: only a new answer is logged."""
        if answer != self._last_claim:
            log.info("%s: claim: %s", self.name, answer)
        self._last_claim = answer

    async def _two_answer(self, now_ns: int) -> bool:
        """Whether two robots have this name; then both are told so, and neither is claimed."""
        change = self._homonyms.change(now_ns)
        if change:
            log.warning("%s", change)
        notice = self._homonyms.notice(now_ns)
        if notice is not None:
            with suppress(LinkError):
                await self._link.ask_all(self._control, encode(notice))
        return self._homonyms.words(now_ns) is not None

    def _on_presence(self, presence: ProcessPresence, here: bool) -> None:
        self._homonyms.on_presence(presence, here)
        if here and presence.role == "slave" and presence.other_version:
            log.warning("%s: %s", self.name, presence.other_version)

    async def _keep_clock(self) -> None:
        async for due in coarse_ticks(TickGrid(monotonic_ns(), round(1e9 / CLOCK.rate_hz))):
            if not asks_clock(due.tick, self.moves):
                continue
            before = self._clock_of
            await self._ask_clock()
            if self._clock_of != before:
                for _ in range(CLOCK_QUICK):
                    await self._ask_clock()

    async def _ask_clock(self) -> None:
        query = self.clock.query(monotonic_ns())
        try:
            payload, arrived_ns = await self._link.ask_stamped(CLOCK, encode(query))
            reply = decode(payload, ClockReply)
        except (LinkError, CodecError):
            return
        # another robot of that name has another clock
        if not self._lease.token or reply.instance == self._lease.instance:
            self._clock_of = reply.instance
            self.clock.on_reply(reply, arrived_ns)

    @property
    def taken(self) -> TakenRobot:
        """Whether this master holds the lease, and when it lost it."""
        return TakenRobot(bool(self._lease.token), self._lease.lost_ns)

    @property
    def states(self) -> int:
        """States that came."""
        return self._watch.arrivals.arrived

    @property
    def moves(self) -> bool:
        """Whether the robot follows this operator, as far as is known: a silent one may still hear."""
        state = self._watch.state
        if state is None or state.guard not in ENGAGED or not self._lease.holds(state):
            return False
        return not self._watch.silent(monotonic_ns(), MOVES_S)

    @property
    def wanted_period_ms(self) -> int | None:
        """What the robot's line lets it ask for between two commands, 0: it does not say.

        None where it does not obey this operator: then it has no say in the rate. One that obeyed and is
        silent asks for nothing any more: what its line carries is not known, and it may hear still.
        """
        state = self._watch.state
        if state is None or not self._lease.holds(state):
            return None
        return 0 if self._watch.silent(monotonic_ns()) else state.wanted_period_ms

    @property
    def sign(self) -> RobotSign:
        """What the operator's alarms need to know of it."""
        state = self._watch.state
        if state is None or self._watch.silent(monotonic_ns()):
            return RobotSign()
        return RobotSign(state.guard, state.reason, self._lease.holds(state), bool(state.faults))

    @property
    def standing(self) -> str:
        """The state of this robot as the master sees it, in words."""
        now_ns = monotonic_ns()
        two = self._homonyms.words(now_ns)
        if two is not None:
            return two
        state = self._watch.state
        if state is None or self._watch.silent(now_ns):
            unread = self._unread and now_ns - self._unread_ns <= to_ns(STATE.timeout_s)
            return f"{self.name}: heard, but {self._unread}" if unread else f"{self.name}: not heard"
        return f"{self.name}: {state.guard if self._lease.token else self._lease.answer}"

    def metrics(self) -> CommandedMetrics:
        """Counters and percentiles of this robot alone."""
        watch = self._watch
        return CommandedMetrics(
            commands_sent=self._writer.sent,
            scaling={} if self._scaling is None else self._scaling.factors,
            round_trip_ms=watch.round_trip.summary(),
            robot=RobotHeard(
                silent=watch.silent(monotonic_ns()),
                times_lost=watch.times_lost,
                undecodable=self._undecodable,
                missing=watch.arrivals.lost,
            ),
            lease=LeaseHeld(bool(self._lease.token), self._lease.answer),
            video=self.video.metrics(),
            link=self._link.counters(),
        )
