"""An encoder that lies: its joint is held and named, alone; and one that does not is never doubted."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from common.skeleton import load_skeleton
from common.wire.messages import Action
from slave.guard import GuardConfig, State
from slave.guard.body import WELL
from slave.guard.plausible import JUMP_SLACK_RAD, EncoderPlausibility, Past
from slave.guard.watchdog import BODY_WATCHES

MakeRig = Callable[..., Any]
SKELETON = load_skeleton("nursing")
JOINTS = SKELETON.joint_names
LEFT, RIGHT = JOINTS.index("left_elbow_pitch"), JOINTS.index("right_elbow_pitch")
CONFIG = GuardConfig()
MS = 1_000_000
TICK = 5 * MS


class Lying:
    """Encoders that show where the servos are, but for some that show what they like."""

    def __init__(self, rig: Any) -> None:
        self.rig = rig
        self.lies: dict[int, Callable[[float], float]] = {}
        self.true_rad = rig.measured.copy()
        rig.coupled = False

    def step(self) -> Any:
        shown = self.true_rad.copy()
        for joint, lie in self.lies.items():
            shown[joint] = lie(float(shown[joint]))
        self.rig.measured = shown
        setpoint = self.rig.step()
        self.true_rad = setpoint.position_rad.copy()
        return setpoint

    def run(self, seconds: float, rate_rad_s: float = 0.0) -> None:
        """Every joint wanders to and fro at a rate, with commands."""
        for i in range(round(seconds / 0.005)):
            if i % 16 == 0:
                self.rig.target = np.clip(
                    self.rig.target + 0.08 * rate_rad_s, SKELETON.lower_rad, SKELETON.upper_rad
                )
                self.rig.send()
            self.step()


@pytest.fixture
def lying(rig: Any) -> Lying:
    return Lying(rig.to_track())


# the part by itself


def plausibility(**changes: Any) -> EncoderPlausibility:
    return EncoderPlausibility(JOINTS, SKELETON.max_velocity_rad_s, GuardConfig(**changes))


def feed(part: EncoderPlausibility, off_rad: Any, readings: int, start: int = 0) -> int:
    """Standing setpoints at 0 and one joint off by that much; the reading that raised the doubt, or 0."""
    for i in range(start + 1, start + readings + 1):
        part.note(i * TICK, np.zeros(len(JOINTS)))
        shown = np.zeros(len(JOINTS))
        shown[LEFT] = off_rad(i) if callable(off_rad) else off_rad
        if part.judge(shown, np.ones(len(JOINTS), np.bool_), i * TICK, moving=True):
            return i
    return 0


@pytest.mark.parametrize("sign", [1, -1])
def test_at_the_window_believed_beyond_it_doubted_after_patience(sign: int) -> None:
    assert feed(plausibility(), sign * CONFIG.follow_window_rad, 1000) == 0
    part = plausibility()
    doubted = feed(part, sign * (CONFIG.follow_window_rad + 1e-9), 1000)
    assert 0 < doubted * 0.005 <= CONFIG.follow_patience_s + 0.005
    assert list(part.words) == ["left_elbow_pitch"]
    assert "0.10 rad from where the joint was sent" in part.words["left_elbow_pitch"]
    assert part.doubted.sum() == 1


def test_astray_for_less_than_the_patience_is_forgiven_and_forgotten() -> None:
    part = plausibility()
    ramp = 2.0 * SKELETON.max_velocity_rad_s[LEFT] * 0.005  # as fast as can be: no jumps
    astray = 13
    for start in (0, 200, 400):
        assert feed(part, lambda i, s=start: min((i - s) * ramp, 0.2), astray, start) == 0
        assert feed(part, 0.0, 200 - astray, start + astray) == 0
    assert feed(part, lambda i: min((i - 600) * ramp, 0.2), 2 * astray, 600) > 0


def test_alternating_truth_and_lies_is_doubted_too() -> None:
    assert feed(plausibility(), lambda i: 0.11 if i % 3 == 0 else 0.0, 1000) > 0


def test_a_single_bad_reading_is_forgiven_and_two_are_not() -> None:
    assert feed(plausibility(), lambda i: 1.0 if i == 10 else 0.0, 200) == 0
    assert feed(plausibility(), lambda i: 1.0 if i in (10, 20) else 0.0, 200) in (20, 21)


@pytest.mark.parametrize(("more", "doubted"), [(-1e-9, False), (1e-9, True)])
def test_a_jump_is_what_the_joint_cannot_do(more: float, doubted: bool) -> None:
    leap = 2.0 * SKELETON.max_velocity_rad_s[LEFT] * 0.005 + JUMP_SLACK_RAD + more
    assert leap < CONFIG.follow_window_rad
    assert bool(feed(plausibility(), lambda i: leap * (i % 2), 50)) is doubted


def test_nothing_is_doubted_while_nothing_moves() -> None:
    part = plausibility()
    for i in range(1, 200):
        part.note(i * TICK, np.zeros(len(JOINTS)))
        assert not part.judge(np.ones(len(JOINTS)), np.ones(len(JOINTS), np.bool_), i * TICK, moving=False)
    assert not part.doubted.any()
    assert part.unsettled() is None


def test_the_same_reading_again_counts_once() -> None:
    part = plausibility()
    for i in range(1, 200):
        part.note(i * TICK, np.zeros(len(JOINTS)))
        assert not part.judge(np.ones(len(JOINTS)), np.ones(len(JOINTS), np.bool_), TICK, moving=True)


@pytest.mark.parametrize("bad", ["invalid", "nan"])
def test_what_is_no_reading_is_no_lie(bad: str) -> None:
    part = plausibility()
    for i in range(1, 200):
        part.note(i * TICK, np.zeros(len(JOINTS)))
        shown, valid = np.zeros(len(JOINTS)), np.ones(len(JOINTS), np.bool_)
        shown[LEFT] = np.nan if bad == "nan" else 2.0
        valid[LEFT] = bad == "nan"
        assert not part.judge(shown, valid, i * TICK, moving=True)


def test_a_clock_that_goes_back_starts_anew() -> None:
    part = plausibility()
    feed(part, 0.0, 100)
    for i in range(100):
        now_ns = -(10**12) + i * TICK
        part.note(now_ns, np.full(len(JOINTS), 1.0))
        assert not part.judge(np.full(len(JOINTS), 1.0), np.ones(len(JOINTS), np.bool_), now_ns, moving=True)


@pytest.mark.parametrize("period_ms", [1, 2, 5, 20, 50, 99])
def test_the_past_reaches_back_as_far_as_it_says_and_little_further(period_ms: int) -> None:
    past = Past(1, 100 * MS)
    past.restart(0, np.array([0.0]))
    for now in range(period_ms, 1000, period_ms):
        past.add(now * MS, np.array([float(now)]))
        low, high = past.span(now * MS)
        assert high[0] == now
        stood = (max(now - 100, 0) // period_ms) * period_ms  # where it stood 100 ms ago
        assert low[0] <= stood
        assert low[0] >= stood - max(2 * period_ms, 13 + period_ms)


def test_a_setpoint_that_stood_long_becomes_past_when_it_moves() -> None:
    past = Past(1, 100 * MS)
    past.restart(0, np.array([3.0]))
    past.add(10_000 * MS, np.array([4.0]))
    assert [end.item() for end in past.span(10_050 * MS)] == [3.0, 4.0]
    past.add(10_120 * MS, np.array([4.0]))
    assert [end.item() for end in past.span(10_150 * MS)] == [4.0, 4.0]


# in the guard


@pytest.mark.parametrize("rate", [0.3, 1.0, 2.0])
def test_a_stuck_encoder_holds_its_joint_alone(lying: Lying, rate: float) -> None:
    stuck = float(lying.true_rad[LEFT])
    lying.lies[LEFT] = lambda _: stuck
    lying.run(1.0, rate)
    guard = lying.rig.guard
    assert guard.state is State.TRACK
    assert list(guard.doubts) == ["left_elbow_pitch"]
    assert guard.counters.doubts == {"left_elbow_pitch": 1}
    assert not guard.counters.losses
    # it stopped soon, and the other arm went on
    before = lying.true_rad.copy()
    lying.run(0.5, -rate)
    assert lying.true_rad[LEFT] == before[LEFT]
    assert abs(before[LEFT] - stuck) <= CONFIG.follow_window_rad + rate * 0.35 + 0.05
    assert lying.true_rad[RIGHT] < before[RIGHT] - 0.1


def test_without_the_doubt_it_would_move_on(lying: Lying, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(EncoderPlausibility, "_doubt", lambda *_: [])
    stuck = float(lying.true_rad[LEFT])
    lying.lies[LEFT] = lambda _: stuck
    lying.run(0.8, 1.0)
    assert lying.true_rad[LEFT] > stuck + 0.6


@pytest.mark.parametrize("joint", range(len(JOINTS)), ids=JOINTS)
def test_every_joint_that_drifts_slowly_is_held_alone(lying: Lying, joint: int) -> None:
    began_ns = lying.rig.now_ns
    lying.lies[joint] = lambda true: true + 0.14e-9 * (lying.rig.now_ns - began_ns)
    lying.run(1.2)
    assert list(lying.rig.guard.doubts) == [JOINTS[joint]]
    assert lying.rig.guard.state is State.TRACK


@pytest.mark.parametrize("joint", range(len(JOINTS)), ids=JOINTS)
def test_every_joint_that_drifts_is_found(lying: Lying, joint: int) -> None:
    began_ns = lying.rig.now_ns
    lying.lies[joint] = lambda true: true + 0.5e-9 * (lying.rig.now_ns - began_ns)
    lying.run(0.6, 0.2)
    # no drift of its encoder can be told from a joint that runs away
    assert lying.rig.guard.state is State.ESTOP
    assert JOINTS[joint] in lying.rig.guard.reason


def test_a_slipped_encoder_is_found_while_the_joint_stands(lying: Lying) -> None:
    lying.lies[LEFT] = lambda true: true + 0.15
    lying.run(0.15)
    assert list(lying.rig.guard.doubts) == ["left_elbow_pitch"]


def lie(joints: int, lying: Lying) -> None:
    for joint in range(joints):
        lying.lies[joint] = lambda true: true - 0.2


def test_as_many_as_may_be_are_held_and_one_more_holds_the_robot(lying: Lying) -> None:
    lie(CONFIG.max_doubted_joints, lying)
    lying.run(0.4)
    assert lying.rig.guard.state is State.TRACK
    assert len(lying.rig.guard.doubts) == CONFIG.max_doubted_joints
    lie(CONFIG.max_doubted_joints + 1, lying)
    lying.run(0.4)
    assert lying.rig.guard.state is State.HOLD
    assert lying.rig.guard.counters.losses == {"plausible": 1}
    assert "4 encoders do not agree" in lying.rig.guard.reason
    assert JOINTS[3] in lying.rig.guard.reason


def test_without_its_watch_any_number_would_be_held_one_by_one(make_rig: MakeRig) -> None:
    watches = tuple(w for w in BODY_WATCHES if w.name != "plausible")
    lying = Lying(make_rig(body_watches=watches).to_track())
    lie(10, lying)
    lying.run(0.4)
    assert lying.rig.guard.state is State.TRACK


def test_a_held_joint_moves_after_its_encoder_agreed_and_a_new_engage(lying: Lying) -> None:
    rig = lying.rig
    lying.lies[LEFT] = lambda true: true + 0.15
    lying.run(0.3)
    lying.lies.clear()
    lying.run(2.0, 0.3)
    assert list(rig.guard.doubts) == ["left_elbow_pitch"], "agreeing is not enough"
    rig.ask(Action.DISENGAGE)
    lying.run(0.5)
    assert list(rig.guard.doubts) == ["left_elbow_pitch"]
    rig.engage()
    assert not rig.guard.doubts
    held = lying.true_rad[LEFT]
    lying.run(1.0)
    assert lying.true_rad[LEFT] != held


def test_engage_waits_until_the_encoder_has_agreed_for_a_while(lying: Lying) -> None:
    rig = lying.rig
    lying.lies[LEFT] = lambda true: true + 0.15
    lying.run(0.3)
    rig.ask(Action.DISENGAGE)
    lying.lies.clear()
    lying.run(CONFIG.follow_patience_s / 0.25 - 0.02)
    reply = rig.ask(Action.ENGAGE)
    assert not reply.done
    assert "left_elbow_pitch" in reply.text
    lying.run(0.05)
    rig.engage()


def test_a_reset_does_not_move_a_joint_to_a_lying_encoder_s_angle(lying: Lying) -> None:
    rig = lying.rig
    lying.lies[LEFT] = lambda true: true + 0.5
    lying.run(0.3)
    rig.ask(Action.ESTOP)
    lying.run(0.3)
    before = lying.true_rad.copy()
    assert rig.ask(Action.RESET, key="a key kept at the robot").done
    lying.step()
    assert lying.true_rad[LEFT] == before[LEFT]


def test_align_does_not_wait_for_a_doubted_joint(make_rig: MakeRig) -> None:
    rig = make_rig().to_leased()
    lying = Lying(rig)
    rig.target[LEFT] += 0.4
    rig.engage()
    stuck = float(lying.true_rad[LEFT])
    lying.lies[LEFT] = lambda _: stuck
    lying.run(1.5)
    assert list(rig.guard.doubts) == ["left_elbow_pitch"]
    assert rig.guard.state is State.TRACK


def test_a_robot_that_is_well_is_believed(lying: Lying) -> None:
    for _ in range(5):
        lying.run(0.4, 3.0)
        lying.run(0.4, -3.0)
    assert lying.rig.body is WELL
    assert not lying.rig.guard.doubts
