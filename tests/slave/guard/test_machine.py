"""Arbitrary sequences of events against what must hold in every one of them."""

from collections.abc import Callable
from typing import Any

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import HealthCheck, settings
from hypothesis.stateful import (
    RuleBasedStateMachine,
    invariant,
    precondition,
    rule,
    run_state_machine_as_test,
)

from common.wire.messages import Action
from slave.guard import State
from slave.guard.body import WELL, Body
from slave.guard.states import ENGAGED, MOVING

KEY = "a key kept at the robot"
EPS = 1e-9
WHO = st.sampled_from(["anna", "ben", ""])


class Machine(RuleBasedStateMachine):
    """Two operators, a network that replays and delays, a body that fails, encoders that lie, and buttons."""

    make_rig: Callable[..., Any]

    def __init__(self) -> None:
        super().__init__()
        self.rig = type(self).make_rig()
        self.tokens: dict[str, int] = {}
        self.sent: list[Any] = []
        self.accepted: set[tuple[int, int]] = set()
        self.may_move = False
        """Whether `engage` was granted and nothing has ended it since."""
        self.latched = False
        self.uncommanded = 0
        self.reseated = False
        """Whether a reset may have put joints where hands had moved them."""
        self.given: list[tuple[int, int]] = []
        """Challenges, and when."""

    # what people do

    @rule(who=WHO)
    def claim(self, who: str) -> None:
        held = self.rig.guard.operator
        reply = self.rig.ask(Action.CLAIM, who)
        if reply.done:
            # nobody held it, or it had lapsed by the time of asking
            assert not held or self.rig.guard.lease.token == reply.lease
            assert reply.lease not in self.tokens.values()
            assert reply.guard not in MOVING
            self.tokens[who] = reply.lease
            self.rig.lease, self.rig.sequence = reply.lease, 0
        self.note()

    @rule(who=WHO)
    def engage(self, who: str) -> None:
        before = self.rig.guard.state
        reply = self.rig.ask(Action.ENGAGE, who)
        if reply.done:
            assert before is State.HOLD
            assert who
            assert who == self.rig.guard.operator
            assert self.rig.body.first_fault is None
            assert not self.rig.guard.doubts
            self.may_move = True
        self.note()

    @rule()
    def status(self) -> None:
        self.given.append((self.rig.ask(Action.STATUS).challenge, self.rig.now_ns))
        self.note()

    @precondition(lambda self: self.given)
    @rule(which=st.integers(0, 10**6), action=st.sampled_from([Action.ENGAGE, Action.RESET]))
    def late_request(self, which: int, action: Action) -> None:
        """What the network brings when it likes: at most one use, and at most 2 s after the question."""
        challenge, given_ns = self.given[which % len(self.given)]
        reply = self.rig.ask(action, "anna", KEY, challenge=challenge)
        if reply.done:
            assert abs(self.rig.now_ns - given_ns) <= 2_000_000_000
            self.given.remove((challenge, given_ns))
            if action is Action.ENGAGE:
                self.may_move = True
            else:
                self.latched, self.reseated = False, True
        self.note()

    @rule(who=WHO, action=st.sampled_from([Action.DISENGAGE, Action.RELEASE, Action.STATUS]))
    def other(self, who: str, action: Action) -> None:
        holder, before = self.rig.guard.operator, self.rig.guard.state
        reply = self.rig.ask(action, who)
        if action is not Action.STATUS and reply.done:
            assert who == holder
            assert self.rig.guard.state not in ENGAGED
        elif before not in ENGAGED:
            assert self.rig.guard.state is before
        self.note()

    @rule(who=WHO, robot=st.sampled_from(["robot-1", "robot-2"]))
    def estop(self, who: str, robot: str) -> None:
        self.rig.ask(Action.ESTOP, who, robot=robot)
        assert self.rig.guard.state is State.ESTOP
        self.latched = True
        self.note()

    @rule(who=WHO, key=st.sampled_from(["", "wrong", KEY]))
    def reset(self, who: str, key: str) -> None:
        reply = self.rig.ask(Action.RESET, who, key)
        if reply.done:
            assert key == KEY
            assert reply.guard == State.HOLD
            self.latched, self.reseated = False, True
        self.note()

    # what the network does

    @rule(
        share=st.floats(-2.0, 2.0),
        rate=st.floats(-20.0, 20.0),
        late_ms=st.sampled_from([-200, -20, 0, 10, 290, 400]),
        deadman=st.sampled_from([True, True, True, False]),
        lost=st.sampled_from([(), (), (6,), (0, 6, 20), tuple(range(25))]),
        clutch_out=st.sampled_from([False, False, True]),
    )
    def command(
        self, share: float, rate: float, late_ms: int, deadman: bool, lost: tuple[int, ...], clutch_out: bool
    ) -> None:
        rig = self.rig
        rig.target = self.posture(share)
        valid = np.ones(rig.joints, np.bool_)
        valid[list(lost)] = False
        rig.sequence += 1
        self.judge(
            rig.command(
                sampled_ns=rig.now_ns - late_ms * 1_000_000,
                deadman_held=deadman,
                clutch_out=clutch_out,
                valid=valid,
                velocity_rad_s=np.full(rig.joints, rate),
            )
        )

    @precondition(lambda self: self.sent)
    @rule(which=st.integers(0, 10**6))
    def replay(self, which: int) -> None:
        self.judge(self.sent[which % len(self.sent)])

    @rule(token=st.sampled_from([0, 1, 1001, 1002, 1003]), sequence=st.integers(0, 10**6))
    def forge(self, token: int, sequence: int) -> None:
        if token != self.rig.lease:
            assert not self.judge(self.rig.command(lease=token, sequence=sequence))

    @rule(seconds=st.sampled_from([0.08, 0.3, 1.5]), share=st.floats(-2.0, 2.0))
    def steady_stream(self, seconds: float, share: float) -> None:
        self.rig.target = self.posture(share)
        for i in range(round(seconds / 0.005)):
            if i % 16 == 0:
                self.rig.sequence += 1
                self.judge(self.rig.command())
            self.step()

    # what the robot does

    @rule(count=st.sampled_from([1, 5, 45, 250]))
    def steps(self, count: int) -> None:
        for _ in range(count):
            self.step()

    @rule(dt_ns=st.sampled_from([0, 1, 12_000_000, 60_000_000, 10**9, 3_600 * 10**9, -3_600 * 10**9]))
    def odd_step(self, dt_ns: int) -> None:
        self.step(dt_ns)

    @rule(joint=st.integers(0, 24), good=st.booleans())
    def encoder(self, joint: int, good: bool) -> None:
        self.rig.encoder_valid[joint] = good

    @rule(joint=st.integers(0, 24), lie=st.sampled_from(["stuck", "slipped", "honest", "honest"]))
    def liar(self, joint: int, lie: str) -> None:
        """An encoder that stays where it is, one that is off, or one that is mended."""
        self.rig.lies.pop(joint, None)
        stuck = float(self.rig.measured[joint])
        if lie == "stuck":
            self.rig.lies[joint] = lambda _: stuck
        elif lie == "slipped":
            self.rig.lies[joint] = lambda true: true + 0.3

    @rule(body=st.sampled_from([WELL, WELL, Body(drives={"neck_yaw": "hot"}), Body(base="tilts")]))
    def change_body(self, body: Body) -> None:
        self.rig.body = body
        self.step()

    # what must hold

    def judge(self, command: Any) -> bool:
        held = self.rig.guard.lease.token
        accepted = bool(self.rig.give(command).accepted)
        if accepted:
            assert command.lease == held != 0, "a lost lease was regained"
            assert (command.lease, command.sequence) not in self.accepted, "a replay was accepted"
            assert command.deadman_held
            self.accepted.add((command.lease, command.sequence))
        self.sent.append(command)
        self.note()
        return accepted

    def step(self, dt_ns: int = 5_000_000) -> None:
        rig = self.rig
        before = rig.setpoints[-1] if rig.setpoints else None
        doubted = [rig.skeleton.joint_names.index(name) for name in rig.guard.doubts]
        setpoint = rig.step(dt_ns)
        self.note()
        assert rig.guard.state not in MOVING or rig.body.first_fault is None, "moves despite a fault"
        assert np.isfinite(setpoint.position_rad).all()
        if before is None or not before.ready:
            return
        dt_s = min(max(dt_ns * 1e-9, 0.0), rig.config.max_step_s)
        p, v = setpoint.position_rad, setpoint.velocity_rad_s
        assert (np.abs(v) <= rig.skeleton.max_velocity_rad_s + EPS).all()
        gain = rig.skeleton.max_acceleration_rad_s2 * dt_s
        assert (np.abs(v - before.velocity_rad_s) <= gain + EPS).all()
        jumped = np.abs(p - before.position_rad - v * dt_s) > EPS
        assert not jumped[doubted].any(), "jumps to where an encoder says that is not believed"
        assert self.reseated or not jumped.any()
        self.reseated = False
        # a joint that was seated beyond its limit only ever moves back
        beyond = np.maximum(rig.skeleton.lower_rad - p, p - rig.skeleton.upper_rad)
        before_beyond = np.maximum(
            rig.skeleton.lower_rad - before.position_rad, before.position_rad - rig.skeleton.upper_rad
        )
        assert (beyond <= np.where(jumped, np.inf, np.maximum(before_beyond, 0.0))).all()
        slower = np.maximum(np.abs(before.velocity_rad_s) - gain, 0.0)
        assert (np.abs(v) <= slower + EPS)[doubted].all(), "a joint whose encoder is not believed moves on"
        if not self.may_move or rig.guard.state is State.CLUTCH:
            assert np.allclose(np.abs(v), slower, rtol=0, atol=EPS), "moves though nobody is engaged"
        elif rig.guard.state is State.ALIGN:
            assert (np.abs(v) <= rig.config.align_velocity_rad_s + EPS).all()

    def note(self) -> None:
        """Motion that has ended stays ended until the next `engage`."""
        self.may_move = self.may_move and self.rig.guard.state in ENGAGED

    @invariant()
    def moving_needs_engage_and_a_lease(self) -> None:
        if self.rig.guard.state in ENGAGED:
            assert self.may_move
            assert self.rig.guard.operator

    @invariant()
    def an_estop_stays(self) -> None:
        # the guard stops by force who moves although it is held; nobody asked for that one
        losses = self.rig.guard.counters.losses["uncommanded"]
        self.latched, self.uncommanded = self.latched or losses > self.uncommanded, losses
        assert (self.rig.guard.state is State.ESTOP) == self.latched

    def posture(self, share: float) -> Any:
        lower, upper = self.rig.skeleton.lower_rad, self.rig.skeleton.upper_rad
        return 0.5 * (lower + upper) + share * 0.5 * (upper - lower)


class Prepared(Machine):
    """The same, from a robot that tracks: most arbitrary sequences never get that far by themselves."""

    def __init__(self) -> None:
        super().__init__()
        self.rig.to_track()
        self.may_move = True
        self.know()

    def know(self) -> None:
        self.tokens["anna"] = self.rig.lease
        self.accepted = {(self.rig.lease, n) for n in range(1, self.rig.sequence + 1)}


class Doubtful(Prepared):
    """From a robot that tracks with two joints held for their encoders: one lies on, one is mended."""

    def __init__(self) -> None:
        super().__init__()
        self.rig.lies = {6: lambda true: true + 0.3, 9: lambda true: true - 0.3}
        self.rig.run(0.3)
        assert len(self.rig.guard.doubts) == 2
        del self.rig.lies[9]
        self.know()


class Delayed(Prepared):
    """From a robot that holds and is ready, with questions answered just now and long ago."""

    def __init__(self) -> None:
        super().__init__()
        self.status()
        self.rig.now_ns += 2_500_000_000
        self.rig.step()
        self.may_move = False
        assert self.rig.claim().done
        self.rig.run(0.1)
        self.status()
        self.know()


LONG = [pytest.param(machine, marks=pytest.mark.long) for machine in (Machine, Doubtful, Delayed)]
"""Each takes 5 s, as does the one that every `make test` runs."""


@pytest.mark.parametrize("machine", [Prepared, *LONG])
def test_any_sequence_keeps_what_must_hold(machine: type[Machine], make_rig: Callable[..., Any]) -> None:
    run(machine, make_rig)


def run(machine: type[Machine], make_rig: Callable[..., Any]) -> None:
    machine.make_rig = staticmethod(make_rig)
    run_state_machine_as_test(
        machine,
        settings=settings(
            max_examples=50,
            stateful_step_count=25,
            deadline=None,
            suppress_health_check=[HealthCheck.too_slow, HealthCheck.filter_too_much],
        ),
    )
