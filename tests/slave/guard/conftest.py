"""A robot on a virtual clock: perfect servos, a tracker that goes where the newest command points."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from common.clock_sync import Offset
from common.link.config import LinkConfig
from common.quaternion import Array
from common.skeleton import load_skeleton
from common.wire.control import CHALLENGED
from common.wire.messages import Action, Command, CommandStamps, ControlReply, ControlRequest
from slave.config import SlaveConfig
from slave.guard import Admission, Guard, GuardConfig, State
from slave.guard.body import WELL
from slave.limit.limit import Setpoint
from slave.pipeline import SlavePipeline
from slave.track import TrackTarget

ROBOT = "robot-1"
KEY = "a key kept at the robot"
PERIOD_NS = 5_000_000
COMMAND_EVERY = 16
MASTER_AHEAD_NS = 3_600_000_000_000
"""The master's clock was started an hour before the slave's."""


GOOD_OFFSET = Offset(MASTER_AHEAD_NS, bound_ns=2_000_000, trusted=True)


class NewestTracker:
    """Target: the newest accepted position, at rest or at the velocity that came with it."""

    def __init__(self) -> None:
        self.resets = 0
        self.accepted: list[tuple[int, int, Array, Array]] = []
        self.newest: TrackTarget | None = None
        self.override: TrackTarget | None = None

    def reset(self) -> None:
        self.resets += 1
        self.newest = None

    def accept(self, sampled_ns: int, now_ns: int, position_rad: Array, velocity_rad_s: Array) -> None:
        self.accepted.append((sampled_ns, now_ns, position_rad, velocity_rad_s))
        self.newest = TrackTarget(position_rad, velocity_rad_s)

    def target(self, now_ns: int) -> TrackTarget | None:
        return self.override if self.newest is not None and self.override is not None else self.newest


class Rig:
    def __init__(self, config: GuardConfig | None = None, **guard_options: Any) -> None:
        self.skeleton = load_skeleton("nursing")
        self.joints = len(self.skeleton.joints)
        self.config = config or GuardConfig(reset_key=KEY, encoder_timeout_s=0.05, jump_window_rad=4.0)
        self.tracker = NewestTracker()
        self.tokens = iter(range(1001, 1_000_000))
        guard_options.setdefault("draw_token", lambda: next(self.tokens))
        self.guard = Guard(ROBOT, self.skeleton, self.config, **guard_options)
        self.pipeline = SlavePipeline(
            SlaveConfig(robot=ROBOT, link=LinkConfig(), guard=self.config),
            guard=self.guard,
            tracker=self.tracker,
        )
        self.now_ns = 10_000_000_000
        self.measured = 0.5 * (self.skeleton.lower_rad + self.skeleton.upper_rad)
        self.encoder_valid = np.ones(self.joints, np.bool_)
        self.encoder_delay_ns = 0
        self.body = WELL
        self.coupled = True
        self.drive_off_rad: Array | None = None
        """(J,) What the drives' own angles are off by; None: they tell none."""
        self.lies: dict[int, Callable[[float], float]] = {}
        """What an encoder shows for the true angle, where it lies."""
        self.target = self.measured.copy()
        self.offset = GOOD_OFFSET
        self.sequence = 0
        self.lease = 0
        self.operator = "anna"
        """On whose key commands arrive."""
        self.setpoints: list[Setpoint] = []
        self._since_command = 0

    # one act each

    def command(self, **changes: Any) -> Command:
        """A good command, 10 ms old, or one with something changed."""
        sampled_ns = changes.pop("sampled_ns", self.now_ns - 10_000_000) + MASTER_AHEAD_NS
        stamps = CommandStamps(sampled_ns, sampled_ns, sampled_ns, sampled_ns)
        good = Command(
            ROBOT, self.lease, self.sequence, 0, stamps, True, np.ones(self.joints, np.bool_),
            self.target.copy(), np.zeros(self.joints), operator=self.operator,
        )  # fmt: skip
        return replace(good, **changes)

    def give(self, command: Command, received_ns: int | None = None) -> Admission:
        received_ns = self.now_ns if received_ns is None else received_ns
        return self.pipeline.take(command, received_ns, self.now_ns, self.offset)

    def send(self, **changes: Any) -> Admission:
        """The master's next command."""
        self.sequence += 1
        return self.give(self.command(**changes))

    def ask(
        self,
        action: Action,
        operator: str = "anna",
        key: str = "",
        robot: str = ROBOT,
        challenge: int | None = None,
        groups: tuple[str, ...] = (),
    ) -> ControlReply:
        """Ask in the way of `common.wire.control`, or with a challenge of one's own."""
        request = ControlRequest(robot, action, operator, key, challenge=challenge or 0, groups=groups)
        if challenge is None and action in CHALLENGED:
            given = self.pipeline.control.answer(
                self.guard, replace(request, action=Action.STATUS), self.now_ns
            ).challenge
            request = replace(request, challenge=given)
        return self.pipeline.control.answer(self.guard, request, self.now_ns)

    def claim(self, operator: str = "anna") -> ControlReply:
        reply = self.ask(Action.CLAIM, operator)
        if reply.done:
            self.lease, self.sequence, self.operator = reply.lease, 0, operator
        return reply

    def step(self, dt_ns: int = PERIOD_NS) -> Setpoint:
        self.now_ns += dt_ns
        read_ns = self.now_ns - self.encoder_delay_ns
        shown = self.shown()
        drive_rad = None if self.drive_off_rad is None else shown + self.drive_off_rad
        setpoint = self.pipeline.step(
            self.now_ns, shown, self.encoder_valid, read_ns, self.body, drive_rad=drive_rad
        )
        if self.coupled and setpoint.ready:
            self.measured = setpoint.position_rad.copy()
        self.setpoints.append(setpoint)
        return setpoint

    def shown(self) -> Array:
        """What the encoders say."""
        out = self.measured.copy() if self.lies else self.measured
        for joint, lie in self.lies.items():
            out[joint] = lie(float(out[joint]))
        return out

    # whole scenes

    def run(self, seconds: float, commands: bool = True, **changes: Any) -> list[Setpoint]:
        """Steps of 5 ms with a command before every 16th; the setpoints."""
        first = len(self.setpoints)
        for _ in range(round(seconds * 1e9 / PERIOD_NS)):
            if commands and self._since_command % COMMAND_EVERY == 0:
                self.send(**changes)
            self._since_command += 1
            self.step()
        return self.setpoints[first:]

    def to_hold(self) -> Rig:
        self.step()
        assert self.guard.state is State.HOLD
        return self

    def to_leased(self) -> Rig:
        self.to_hold()
        assert self.claim().done
        self.run(0.1)
        return self

    def to_align(self) -> Rig:
        self.to_leased()
        self.engage()
        return self

    def engage(self) -> None:
        reply = self.ask(Action.ENGAGE)
        assert reply.done, reply.text
        assert self.guard.state is State.ALIGN

    def to_track(self) -> Rig:
        self.to_align()
        self.run(0.4)
        assert self.guard.state is State.TRACK
        return self

    def to(self, state: State) -> Rig:
        match state:
            case State.HOLD:
                self.to_leased()
            case State.ALIGN:
                self.to_align()
            case State.TRACK:
                self.to_track()
            case State.CLUTCH:
                self.to_track()
                self.send(clutch_out=True)
            case State.ESTOP:
                self.to_leased()
                self.guard.estop(self.now_ns)
            case State.BOOT:
                pass
        assert self.guard.state is state
        return self


@pytest.fixture
def make_rig() -> Callable[..., Rig]:
    return Rig


@pytest.fixture
def rig() -> Rig:
    return Rig()
