"""The whole way on a virtual clock: suit, master, slave and robot step together, far faster than real time.

The same pure parts as in the processes, with the hosts' clocks apart and messages under way between them.
"""

from __future__ import annotations

import heapq
import itertools
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial

from common.clock import NS_PER_MS, NS_PER_S
from common.codec import decode, encode
from common.config import Model, load_config
from common.control import CHALLENGED
from common.messages import Action, ClockReply, Command, ControlReply, ControlRequest, RobotState
from common.offset import MasterExchange
from deploy.judge import Trace
from deploy.profiles import NURSING, example
from master.config import MasterConfig
from master.lease import LeaseKeeper
from master.pipeline import CommandWriter, MasterPipeline, Solved
from master.suit.protocol import SuitProtocol
from master.suit.simulated.config import SuitConfig
from master.suit.simulated.faults import Outgoing
from master.suit.simulated.suit import build_suit
from slave.config import SlaveConfig
from slave.pipeline import SlavePipeline
from slave.servos.simulated import SimulatedRobot

PERIOD_NS = 5 * NS_PER_MS
NODE_NS = NS_PER_MS
"""From SYNC to a node's answer."""
SOLVE_NS = NS_PER_MS // 2
SLAVE_PHASE_NS = 2_300_000
"""The slave's ticks do not fall on the master's."""


@dataclass(frozen=True, slots=True)
class World:
    """How the two hosts and the way between them are."""

    slave_ahead_ns: int = 7_123_456_789_012
    """The slave's clock minus the master's at the start."""
    slave_drift_ppm: float = 20.0
    one_way_ns: int = 2 * NS_PER_MS
    profile: str = NURSING
    overrides: dict[str, list[str]] = field(default_factory=dict)
    """Of the example files, by role."""


class VirtualRun:
    """One run; `now_ns` is the master's clock. Deterministic."""

    def __init__(self, world: World) -> None:
        self._world = world
        self.master_config = _load(MasterConfig, "master", world)
        self.slave_config = _load(SlaveConfig, "slave", world)
        self._protocol = SuitProtocol.load(self.master_config.capture.dbc)
        self._suit = build_suit(_load(SuitConfig, "suit", world), self._protocol)
        self._master = MasterPipeline(self.master_config, self._protocol)
        self._writer = CommandWriter(self.master_config.robot)
        self._lease = LeaseKeeper(self.master_config.robot, self.master_config.operator.name)
        self.clock = MasterExchange()
        self.slave = SlavePipeline(self.slave_config, draw_token=itertools.count(1).__next__)
        self.now_ns = NS_PER_S
        self._robot = SimulatedRobot(
            self.slave_config.skeleton, self.slave_config.encoders, origin_ns=self.slave_ns
        )
        self.trace = Trace(self.slave_config.skeleton.joint_names)
        self.commands: list[Command] = []
        self.states: list[RobotState] = []
        self.deliver: Callable[[bytes], bool] = lambda _: True
        """Whether a command passes the link; a test may cut it."""
        self._under_way: list[tuple[int, int, Callable[[], None]]] = []
        self._order = itertools.count()
        self._tick = 0

    @property
    def slave_ns(self) -> int:
        """The slave's clock now."""
        drift = self.now_ns * self._world.slave_drift_ppm * 1e-6
        return self.now_ns + self._world.slave_ahead_ns + round(drift)

    def run(self, seconds: float, until: Callable[[], bool] = lambda: False) -> None:
        """Go on for some time of the master's clock, or until a condition holds."""
        end_ns = self.now_ns + round(seconds * NS_PER_S)
        while self.now_ns < end_ns and not until():
            self._step()

    def ask(self, action: Action, key: str = "") -> ControlReply:
        """Ask the robot, as the operator, now."""
        operator = self.master_config.operator.name
        request = ControlRequest(self.master_config.robot, action, operator, key)
        if action in CHALLENGED:
            request = replace(request, challenge=self.ask(Action.STATUS).challenge)
        return decode(self.slave.on_control(encode(request), self.slave_ns), ControlReply)

    def _step(self) -> None:
        begin_ns = self.now_ns
        self._at(begin_ns, self._capture)
        self._at(begin_ns + SLAVE_PHASE_NS, self._drive)
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
        sync, late = self._master.tick(self._tick - 1, self.now_ns)
        if late is not None:
            self._put(late)
        answer = self._suit.on_sync(self._protocol.parse_sync(sync.data), self.now_ns)
        if answer.truth is not None:
            self.trace.add(answer.truth)
        for delay_ns, together in itertools.groupby(answer.frames, key=lambda frame: frame.delay_ns):
            self._at(self.now_ns + NODE_NS + delay_ns, partial(self._on_frames, list(together)))

    def _on_frames(self, frames: list[Outgoing]) -> None:
        for bus, frame, _ in frames:
            if self._master.frame(bus, frame.id, frame.data, self.now_ns):
                solved = self._master.close(self.now_ns)
                if solved is not None:
                    self._put(solved)

    def _put(self, solved: Solved) -> None:
        put_ns = self.now_ns + SOLVE_NS
        command = self._writer.write(solved, self._lease.token, True, put_ns, put_ns)
        self.commands.append(command)
        self.trace.add(command)
        payload = encode(command)
        if self.deliver(payload):
            self._at(put_ns + self._world.one_way_ns, lambda: self._on_command(payload))

    def _on_command(self, payload: bytes) -> None:
        self.slave.on_command(payload, self.slave_ns, self.slave_ns)

    def _drive(self) -> None:
        now_ns = self.slave_ns
        self._robot.advance(now_ns)
        setpoint = self.slave.tick(now_ns, self._robot.read())
        if setpoint.ready:
            self._robot.write(setpoint.position_rad)
            self.slave.written(now_ns)
        if self._tick % self.slave_config.loop.state_every == 0:
            payload = self.slave.state(now_ns)
            self._at(self.now_ns + self._world.one_way_ns, lambda: self._on_state(payload))

    def _on_state(self, payload: bytes) -> None:
        state = decode(payload, RobotState, len(self.slave_config.skeleton.joints))
        self.states.append(state)
        self._lease.on_state(state, self.now_ns)
        request = self._lease.request(self.now_ns)
        if request is not None:
            reply = self.slave.on_control(encode(request), self.slave_ns)
            self._lease.on_reply(decode(reply, ControlReply), self.now_ns)

    def _exchange_clocks(self) -> None:
        query = encode(self.clock.query(self.now_ns))
        self._at(self.now_ns + self._world.one_way_ns, lambda: self._on_clock(query))

    def _on_clock(self, query: bytes) -> None:
        reply = self.slave.on_clock(query, self.slave_ns, self.slave_ns)
        back_ns = self.now_ns + self._world.one_way_ns
        self._at(back_ns, lambda: self._on_clock_reply(reply))

    def _on_clock_reply(self, reply: bytes) -> None:
        self.clock.on_reply(decode(reply, ClockReply), self.now_ns)


def _load(model: type[Model], role: str, world: World) -> Model:
    return load_config(example(role, world.profile), model, world.overrides.get(role, ()))
