"""The whole system on a virtual clock: suit, master, slave and robot, far faster than real time.

It runs the same pipelines as the processes. The two hosts have different clocks, and messages take time
between them. Faults are injected through `VirtualWorld.inject`.
"""

from __future__ import annotations

import heapq
import itertools
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial

from common.clock import NS_PER_MS, NS_PER_S
from common.clock_sync import MasterExchange
from common.config.load import Model, load_config
from common.errors import TandemError
from common.metrics.master import Unreached
from common.wire.codec import decode, encode
from common.wire.control import CHALLENGED, read_reply, request_bytes
from common.wire.messages import Action, ClockReply, Command, ControlReply, ControlRequest, RobotState
from deploy.examples.profiles import NURSING, example
from deploy.measure import MovedSeries, Trace
from deploy.sim.network.profile import Profile, Way
from deploy.sim.patient.robot import Imperfect, TouchingRobot
from deploy.sim.suit.config import SuitConfig
from deploy.sim.suit.faults import Outgoing
from deploy.sim.suit.motion import OperatorMotion
from deploy.sim.suit.suit import build_suit
from deploy.sim.world.hands import OperatorHands
from deploy.sim.world.injection import FaultInjection, Traffic
from deploy.sim.world.link import VirtualLink
from master.comfort.scaling import MotionScaling
from master.command_rate import CommandRate
from master.config import MasterConfig
from master.deadman.grip import Grip
from master.joint_angles.sample import JointAngleSample
from master.lease import LeaseKeeper
from master.pipeline import CommandWriter, MasterPipeline
from master.suit.protocol import SuitProtocol
from slave.config import SlaveConfig
from slave.pipeline import SlavePipeline
from slave.servos.mujoco.simulated import SimulatedRobot

PERIOD_NS = 5 * NS_PER_MS
NODE_NS = NS_PER_MS
"""From SYNC to a node's answer."""
ANGLES_NS = NS_PER_MS // 2
SLAVE_PHASE_NS = 2_300_000
"""The slave's ticks do not fall on the master's."""
OFFSET_S = 6
"""Over a slow link it takes some seconds until the clocks' offset is known."""
ALIGN_S = 15.0


@dataclass(frozen=True, slots=True)
class WorldSettings:
    """The two hosts, the link between them, and the files that they are configured by."""

    start_ns: int = NS_PER_S
    """What the master's clock shows when the run begins."""
    slave_ahead_ns: int = 7_123_456_789_012
    """The slave's clock minus the master's at the start."""
    slave_drift_ppm: float = 20.0
    one_way_ns: int = 2 * NS_PER_MS
    """Delay of a perfect link; used without a `network`."""
    network: Profile | None = None
    """A profile of an emulated network. Its outages are not played."""
    network_seed: int = 1
    profile: str = NURSING
    motion: OperatorMotion | None = None
    """The operator's; None: the one that the suit's file names."""
    patient: bool = False
    """Whether a soft patient may be put in the robot's way (`deploy/sim/patient`)."""
    overrides: dict[str, list[str]] = field(default_factory=dict)
    """Changes to the example files, by role."""


class VirtualWorld:
    """One run, deterministic. `now_ns` is true time, and the master's clock until that is stepped."""

    def __init__(self, world: WorldSettings) -> None:
        self._world = world
        self.inject = FaultInjection()
        network = world.network or Profile(both=Way(delay_ms=world.one_way_ns / NS_PER_MS))
        self.link = VirtualLink(network, world.network_seed, self._at)
        self.master_config = _load(MasterConfig, "master", world)
        self.robot = self.master_config.commanded[0]
        self.slave_config = _load(SlaveConfig, "slave", world)
        self._protocol = SuitProtocol.load(self.master_config.capture.dbc)
        self.suit = build_suit(_load(SuitConfig, "suit", world), self._protocol, world.motion)
        self._master = MasterPipeline(self.master_config, self._protocol)
        self._scaling = MotionScaling(self.master_config.operator.scaling, self.master_config.skeleton)
        self._writer = CommandWriter(self.robot, self._scaling)
        self.hands = OperatorHands(self.master_config)
        self._rate = CommandRate(self.master_config.capture.rate)
        self._newest: JointAngleSample | None = None
        self._lease = LeaseKeeper(self.robot, self.master_config.operator.name)
        self.clock = MasterExchange()
        self.slave = SlavePipeline(self.slave_config, draw_token=itertools.count(1).__next__, instance=1)
        self.now_ns = world.start_ns
        skeleton, encoders = self.slave_config.skeleton, self.slave_config.encoders
        self.touching: TouchingRobot | None = None
        """The robot, where there may be a patient."""
        if world.patient:
            self.touching = TouchingRobot(skeleton, Imperfect(), encoders=encoders, origin_ns=self.slave_ns)
        self._robot = self.touching or SimulatedRobot(skeleton, encoders, origin_ns=self.slave_ns)
        self.trace = Trace(self.slave_config.skeleton.joint_names)
        self.commands: list[Command] = []
        self.states: list[RobotState] = []
        self.said: list[str] = []
        """What the master told the operator with a sound."""
        self._under_way: list[tuple[int, int, Callable[[], None]]] = []
        self._order = itertools.count()
        self._tick = 0
        loop_ns = NS_PER_S / self.slave_config.loop.rate_hz
        self._drive_every = max(1, round(loop_ns / PERIOD_NS))
        """Ticks to one turn of the slave's loop: 200, 100, 67, 50 … a second."""

    @property
    def simulated(self) -> SimulatedRobot:
        """The robot's physics. TypeError where it is one that a patient may touch."""
        if not isinstance(self._robot, SimulatedRobot):
            raise TypeError("expected a world without a patient")
        return self._robot

    @property
    def master_ns(self) -> int:
        """The master's clock now."""
        return self.now_ns + self.inject.master_stepped_ns

    @property
    def slave_ns(self) -> int:
        """The slave's clock now."""
        return self._robot_ns + self.inject.slave_stepped_ns

    @property
    def _robot_ns(self) -> int:
        """Time at the robot itself, however the slave's clock is stepped."""
        drift = self.now_ns * self._world.slave_drift_ppm * 1e-6
        return self.now_ns + self._world.slave_ahead_ns + round(drift)

    def beyond_reach(self) -> dict[str, Unreached]:
        """What of the operator the robot could not follow, as the master counts it."""
        return self._master.beyond_reach.metrics()

    def take_zero_pose_again(self) -> None:
        """The operator asks for it, by a key."""
        self._master.zero_pose.ask("a key", self.master_ns)

    def run(self, seconds: float, until: Callable[[], bool] = lambda: False) -> None:
        """Go on for some time of the master's clock, or until a condition holds."""
        end_ns = self.now_ns + round(seconds * NS_PER_S)
        while self.now_ns < end_ns and not until():
            self._step()

    def engage(self) -> None:
        """Engage as soon as possible; go on until the robot tracks. Raises TandemError with the reason."""
        self.run(10.0, until=self._suit_known)
        for _ in range(OFFSET_S):
            self.run(1.0)
            reply = self.ask(Action.ENGAGE)
            if reply.done:
                break
        else:
            raise TandemError(reply.text)
        self.run(ALIGN_S, until=lambda: self.slave.guard.state == "track")
        if self.slave.guard.state != "track":
            raise TandemError(self.slave.guard.reason)

    def _suit_known(self) -> bool:
        return bool(self.commands and self.commands[-1].valid.all() and self.commands[-1].lease)

    def moved(self) -> MovedSeries:
        """The encoders' series, its stamps on the suit's clock, which is the master's."""
        series = self.trace.moved()
        return replace(series, encoder_ns=series.encoder_ns - (self.slave_ns - self.now_ns))

    def stand_still(self, seconds: float) -> None:
        """Both processes are stopped for so long: nobody ticks, puts or takes anything; time goes by."""
        ticks = round(seconds * NS_PER_S / PERIOD_NS)
        self.now_ns += ticks * PERIOD_NS
        self._tick += ticks

    def ask(
        self, action: Action, key: str = "", operator: str | None = None, groups: tuple[str, ...] = ()
    ) -> ControlReply:
        """Ask the robot now; as the master's operator by default."""
        operator = self.master_config.operator.name if operator is None else operator
        request = ControlRequest(self.robot, action, operator, key, groups=groups)
        if action in CHALLENGED:
            request = replace(request, challenge=self.ask(Action.STATUS, operator=operator).challenge)
        answer = self.slave.on_control(request_bytes(request), self.slave_ns, sender=operator)
        return read_reply(answer, action)

    def _step(self) -> None:
        begin_ns = self.now_ns
        self._at(begin_ns, self._capture)
        if (self._tick + 1) % self._drive_every == 0:
            self._at(begin_ns + SLAVE_PHASE_NS, self._drive)
        if self._tick % 4 == 0:
            self._at(begin_ns + NODE_NS, self._send_buttons)
        if self._tick % 50 == 0:
            self._at(begin_ns + NODE_NS // 2, self._exchange_clocks)
        self._tick += 1
        while self._under_way and self._under_way[0][0] < begin_ns + PERIOD_NS:
            self.now_ns, _, event = heapq.heappop(self._under_way)
            event()
        self.now_ns = begin_ns + PERIOD_NS

    def _at(self, when_ns: int, event: Callable[[], None]) -> None:
        heapq.heappush(self._under_way, (when_ns, next(self._order), event))

    def _capture(self) -> None:
        sync, late = self._master.tick(self._tick - 1, self.master_ns)
        if late is not None:
            self._put(late)
        if not self.inject.suit_heard:
            for bus in self.master_config.capture.buses:
                self._master.bus_down(bus.name)
            self.hands.bus_down()
            self.look()
            return
        answer = self.suit.on_sync(self._protocol.parse_sync(sync.data), self.now_ns)
        if answer.truth is not None:
            self.trace.add(answer.truth)
        for delay_ns, together in itertools.groupby(answer.frames, key=lambda frame: frame.delay_ns):
            self._at(self.now_ns + NODE_NS + delay_ns, partial(self._on_frames, list(together)))

    def _on_frames(self, frames: list[Outgoing]) -> None:
        for bus, frame, _ in frames:
            if self._master.frame(bus, frame.id, frame.data, self.master_ns):
                angles = self._master.close(self.master_ns)
                if angles is not None:
                    self._put(angles)

    def _send_buttons(self) -> None:
        if self.inject.suit_heard:
            self.hands.send_buttons(self.master_ns)
        self.look()
        if self._tick == 1:
            for name in self.hands.buttons:
                self.hands.press(name, self.master_ns)

    def look(self) -> None:
        """A switch of the operator has changed: the master looks, and tells at once what he let go."""
        grip = self.hands.grip.ended(self.master_ns)
        if grip is not None and self._newest is not None:
            self._put_with(self._newest, grip, self.master_ns)

    def _put(self, angles: JointAngleSample) -> None:
        self._newest = angles
        put_ns = self.master_ns + ANGLES_NS
        self._put_with(angles, self.hands.grip.take(put_ns), put_ns)

    def _put_with(self, angles: JointAngleSample, grip: Grip, put_ns: int) -> None:
        command = self._writer.write(angles, self._lease.token, grip, put_ns, put_ns)
        self.commands.append(command)
        self.trace.add(command)
        self.said += self._master.said
        self._carry(Traffic.COMMAND, encode(command), self.on_command, ANGLES_NS)

    def on_command(self, payload: bytes, sender: str | None = None) -> None:
        """A command reaches the slave now, on the key of the master's operator by default."""
        sender = self.master_config.operator.name if sender is None else sender
        self.slave.on_command(payload, self.slave_ns, self.slave_ns, sender=sender)

    def _carry(
        self, traffic: Traffic, payload: bytes, arrive: Callable[[bytes], None], after_ns: int = 0
    ) -> None:
        for later_ns, carried in self.inject.carry(traffic, payload):
            arrived = partial(arrive, carried)
            if later_ns:
                arrived = partial(self._after, later_ns, arrived)
            self._at(self.now_ns + after_ns, partial(self._send, traffic, len(carried), arrived))

    def _send(self, traffic: Traffic, size: int, arrived: Callable[[], None]) -> None:
        self.link.send(traffic, self.now_ns, size, arrived)

    def _after(self, later_ns: int, event: Callable[[], None]) -> None:
        self._at(self.now_ns + later_ns, event)

    def _drive(self) -> None:
        now_ns = self.slave_ns
        self._robot.advance(self._robot_ns)
        true = self._robot.read()
        reading = replace(true, read_ns=true.read_ns + self.inject.slave_stepped_ns)
        setpoint = self.slave.tick(now_ns, self.inject.read(reading), self.inject.body())
        self.inject.watch(true, setpoint)
        if setpoint.ready:
            self._robot.limit_torque(setpoint.torque_nm)
            self._robot.write(self.inject.write(setpoint.position_rad))
            self.slave.written(now_ns)
        if self._tick % (self._drive_every * self.slave_config.loop.state_every) == 0:
            self._carry(Traffic.STATE, self.slave.state(now_ns), self._on_state)

    def _on_state(self, payload: bytes) -> None:
        state = decode(payload, RobotState, len(self.slave_config.skeleton.joints))
        self.states.append(state)
        self.trace.add(state)
        self._lease.on_state(state, self.master_ns)
        self._scaling.on_state(state.guard, state.resting)
        if self._rate.follow({self.robot: state.wanted_period_ms} if self._lease.holds(state) else {}):
            self._master.set_decimation(self._rate.decimation)
        request = self._lease.request(self.master_ns)
        if request is not None:
            reply = self.slave.on_control(encode(request), self.slave_ns, sender=request.operator)
            self._lease.on_reply(decode(reply, ControlReply), self.master_ns)

    def _exchange_clocks(self) -> None:
        self._carry(Traffic.QUERY, encode(self.clock.query(self.master_ns)), self._on_clock)

    def _on_clock(self, query: bytes) -> None:
        reply = self.slave.on_clock(query, self.slave_ns, self.slave_ns)
        self._carry(Traffic.REPLY, reply, self._on_clock_reply)

    def _on_clock_reply(self, reply: bytes) -> None:
        self.clock.on_reply(decode(reply, ClockReply), self.master_ns)


def _load(model: type[Model], role: str, world: WorldSettings) -> Model:
    return load_config(example(role, world.profile), model, world.overrides.get(role, ()))
