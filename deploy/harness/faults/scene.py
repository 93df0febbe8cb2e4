"""The scene of a trial: a robot follows a reaching operator on a virtual clock; every tick is recorded."""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Callable, Set
from dataclasses import dataclass, replace
from functools import cache, partial
from importlib import resources

import numpy as np

from common.clock import NS_PER_MS, NS_PER_S, to_s
from common.errors import TandemError
from common.skeleton import Skeleton, load_skeleton
from common.wire.messages import Action, Command, Mask
from deploy.examples.profiles import NURSING
from deploy.harness.faults.judge import Asked
from deploy.harness.faults.setting import USUAL, Later, Setting, files
from deploy.measure.stillness import StoppingMotion
from deploy.sim.suit.minimum_jerk import MinimumJerkMotion, Move
from deploy.sim.suit.motion import OperatorMotion, parse_motion
from deploy.sim.suit.postures import POSTURES, robot_posture
from deploy.sim.world.injection import FaultInjection
from deploy.sim.world.world import VirtualWorld, WorldSettings
from slave.encoders.counts import Encoders
from slave.guard import GATES, Guard, State
from slave.guard.watchdog import ARRIVAL_WATCHES, BODY_WATCHES
from slave.limit.limit import Setpoint
from slave.servos.servos import EncoderReading

RESET_KEY = "kept at the robot"
UP_NS = 7_200 * NS_PER_S
"""The hosts have been up for two hours: their clocks can be set back by one."""
TODAYS_TOKENS = 1_000_001
"""Tokens are random in a real robot; here those of another run's leases must differ too."""
ENGAGED_S = 1.1
"""Into the operator's motion: he stands still, every joint and the clocks' offset are known."""
REACHING_S = 2.1
"""In the middle of the reach."""
BEFORE_S = 0.2
"""How much of the course before the fault is kept."""
JOINT_TURN_RAD = 0.5
"""How far foul commands ask every joint to be from where it is."""


@cache
def reach(profile: str = NURSING) -> OperatorMotion:
    """Both arms and the head at once, joints of the right arm twice as fast as those of paper A's nurse.

    Of another robot than the nursing one: as its joints take a person's postures, at the same times.
    """
    if profile != NURSING:
        return _reach_of(load_skeleton(profile))
    text = resources.files(__package__).joinpath("reach.toml").read_text("utf-8")
    return parse_motion(text, load_skeleton(NURSING), source="reach.toml")


def _reach_of(skeleton: Skeleton) -> OperatorMotion:
    rest, there, elsewhere = (
        robot_posture(skeleton, POSTURES[name])[0] for name in ("zero pose", "reaching", "elbows bent")
    )
    moves = [
        Move(name, start_s, duration_s, float(to[j]))
        for to, start_s, duration_s in ((there, 1.6, 1.0), (elsewhere, 2.9, 1.0), (rest, 6.0, 3.0))
        for j, name in enumerate(skeleton.joint_names)
    ]
    return MinimumJerkMotion(skeleton.joint_names, rest, moves, period_s=60.0)


@dataclass(frozen=True, slots=True)
class _RobotTick:
    """What the robot did in one of its ticks."""

    now_ns: int
    """True time."""
    slave_ns: int
    """Time on the slave's own clock."""
    state: State
    reading: EncoderReading
    setpoint: Setpoint


def _read_as(valid: Mask, reading: EncoderReading) -> EncoderReading:
    return EncoderReading(reading.read_ns, reading.counts, valid)


def turned(command: Command, by_rad: float = JOINT_TURN_RAD) -> Command:
    """A command as if it came next; were it accepted, it would be seen at the robot."""
    return replace(command, sequence=command.sequence + 1, position_rad=command.position_rad + by_rad)


class Scene:
    """One run up to the fault, and beyond. `without`: names of the gates and watches that the guard lacks."""

    def __init__(self, setting: Setting = USUAL, without: Set[str] = frozenset()) -> None:
        self._begins_s = setting.lead_s
        self.profile = setting.profile
        with files(setting) as master:
            overrides = {
                "slave": [f'guard.reset_key="{RESET_KEY}"', *setting.slave],
                "suit": list(setting.suit), "master": master,
            }  # fmt: skip
            usual = reach(setting.profile) if setting.motion is None else setting.motion()
            motion: OperatorMotion = Later(usual, setting.lead_s) if setting.lead_s else usual
            self.run = VirtualWorld(
                WorldSettings(
                    start_ns=UP_NS, motion=motion, overrides=overrides,
                    one_way_ns=round(setting.one_way_ms * NS_PER_MS), patient=setting.patient,
                    profile=setting.profile,
                )
            )  # fmt: skip
        config = self.run.slave_config
        self.skeleton = config.skeleton
        self.run.slave.guard = Guard(
            config.robot,
            self.skeleton,
            config.guard,
            draw_token=itertools.count(TODAYS_TOKENS).__next__,
            gates=[gate for gate in GATES if gate.name not in without],
            arrival_watches=[watch for watch in ARRIVAL_WATCHES if watch.name not in without],
            body_watches=[watch for watch in BODY_WATCHES if watch.name not in without],
        )
        self.foul = 0
        """Commands that should never have been accepted, and were."""
        self.granted: list[str] = []
        """Requests that should never have been granted, and were."""
        self.fault_ns = 0
        self.dropped_before: Counter[str] = Counter()
        self.undo: Callable[[], None] = lambda: None
        """Ends the fault."""
        self.each_period: Callable[[], None] = lambda: None
        """Called at the rate of commands, 12.5 Hz, from the fault on."""
        self.encoders = Encoders(self.skeleton, config.encoders)
        self._seen: list[_RobotTick] = []
        self.inject.watch = self._watch

    def _watch(self, reading: EncoderReading, setpoint: Setpoint) -> None:
        self._seen.append(_RobotTick(self.run.now_ns, self.run.slave_ns, self.guard.state, reading, setpoint))
        if len(self._seen) % self.run.master_config.capture.rate.usual == 0:
            self.each_period()

    @property
    def inject(self) -> FaultInjection:
        """Where faults enter the virtual world."""
        return self.run.inject

    @property
    def guard(self) -> Guard:
        """The robot's."""
        return self.run.slave.guard

    @property
    def elapsed_s(self) -> float:
        """Since the operator began, the setting's lead left out."""
        return to_s(self.run.now_ns - UP_NS) - self._begins_s

    def to(self, state: State) -> None:
        """Bring the robot to a state. Raises TandemError where it does not get there."""
        if state is State.BOOT:
            blind = np.zeros(len(self.skeleton.joints), np.bool_)
            self.inject.read = partial(_read_as, blind)
        self.run.run(self._begins_s + ENGAGED_S)
        if state in (State.ALIGN, State.TRACK):
            if state is State.ALIGN:  # once the operator has reached, so that there is some way to go
                self.run.run(REACHING_S)
            self.engage()
        if state is State.TRACK:
            self.run.run(REACHING_S - self.elapsed_s)
        elif state is State.ALIGN:
            self.run.run(0.6)
        elif state is State.ESTOP:
            self.run.ask(Action.ESTOP)
            self.run.run(0.2)
        if self.guard.state is not state:
            raise TandemError(f"the trial cannot begin: {self.guard.state}, {self.guard.reason}")

    def engage(self) -> None:
        """Engage the robot as its operator. Raises TandemError if the robot refuses."""
        reply = self.run.ask(Action.ENGAGE)
        if not reply.done:
            raise TandemError(f"the trial cannot begin: {reply.text}")

    def begin(self) -> None:
        """From now on it counts as after the fault."""
        self.fault_ns = self.run.now_ns
        self.dropped_before = self.refused()

    def command(self, payload: bytes, sender: str | None = None) -> None:
        """A foul command reaches the robot now, on the key of its operator or of another."""
        before = self.guard.counters.accepted
        self.run.on_command(payload, sender)
        self.foul += self.guard.counters.accepted - before

    def command_decoded(self, command: Command) -> None:
        """The same, had the codec let it pass."""
        now_ns = self.run.slave_ns
        offset = self.run.slave.clock.estimator.estimate(now_ns)
        command = replace(command, operator=self.run.master_config.operator.name)
        self.foul += self.run.slave.take(command, now_ns, now_ns, offset).accepted

    def ask(self, action: Action, operator: str) -> None:
        """Ask for what must be refused."""
        if self.run.ask(action, operator=operator).done:
            self.granted.append(str(action))

    def refuses_to_engage(self, words: str) -> None:
        """The operator asks to engage, and is to be refused in these words."""
        reply = self.run.ask(Action.ENGAGE)
        if reply.done or words not in reply.text:
            self.granted.append(f"engage ({reply.text or 'done'}), which was to be refused for: {words}; it")

    def newest(self) -> Command:
        """The master's last command."""
        return self.run.commands[-1]

    def refused(self) -> Counter[str]:
        """Commands refused so far, by gate; `codec` for those that could not be read."""
        return self.guard.counters.dropped + Counter(codec=self.run.slave.unread.counts.get("command", 0))

    def state_reached_s(self, state: State) -> float | None:
        """When the guard was in a state to stay, after the fault; None where it is not at the end."""
        since = None
        for row in self._seen:
            if row.now_ns >= self.fault_ns:
                since = None if row.state is not state else row.now_ns if since is None else since
        return None if since is None else to_s(since - self.fault_ns)

    def course(self) -> StoppingMotion:
        """From shortly before the fault to now."""
        rows = self._recent()
        return StoppingMotion(
            at_s=np.array([to_s(row.now_ns - self.fault_ns) for row in rows]),
            setpoint_rad=np.array([row.setpoint.position_rad for row in rows]),
            encoder_rad=np.array([self.encoders.position_rad(row.reading.counts) for row in rows]),
        )

    def asked(self) -> Asked:
        """What the guard asked of the drives meanwhile, in its own time."""
        rows = self._recent()
        steps_s = np.diff([row.slave_ns for row in rows]) / NS_PER_S
        return Asked(
            step_s=np.clip(steps_s, 0.0, self.run.slave_config.guard.max_step_s),
            position_rad=np.array([row.setpoint.position_rad for row in rows]),
            velocity_rad_s=np.array([row.setpoint.velocity_rad_s for row in rows]),
        )

    def _recent(self) -> list[_RobotTick]:
        return [row for row in self._seen if row.now_ns >= self.fault_ns - round(BEFORE_S * NS_PER_S)]
