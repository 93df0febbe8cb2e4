"""Each joint stands where it is said to, and stays there: in every state, whatever the backend."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from common.clock import NS_PER_MS
from common.wire.messages import Action
from slave.encoders.agreement import WINDOW_RAD, EncoderAgreement
from slave.encoders.uncommanded import ASTRAY_RAD, SHAKEN_NS, SHAKES_RAD, STILL_RAD, UncommandedMotion
from slave.guard import State
from slave.guard.placed import BEYOND_RAD, NEAR_RAD, PATIENCE, READINGS

MakeRig = Callable[..., Any]
KEY = "a key kept at the robot"
ELBOW = 6
ONE = np.ones(1, np.bool_)
TICK = 5_000_000


def run_away(rig: Any, rate_deg_s: float) -> float:
    """Until it is stopped: seconds since the joint had moved by its play, 1 degree."""
    rig.coupled = False
    rig.measured = rig.measured.copy()
    began_ns = rig.now_ns + round(1e9 / abs(rate_deg_s))
    for i in range(400):
        rig.measured[ELBOW] += math.radians(rate_deg_s) * 0.005
        if i % 16 == 0 and rig.lease:
            rig.send()
        rig.step()
        if rig.guard.state is State.ESTOP:
            break
    assert rig.guard.state is State.ESTOP
    assert "by itself" in rig.guard.reason or "against" in rig.guard.reason
    return float(rig.now_ns - began_ns) / 1e9


@pytest.mark.parametrize("rate_deg_s", [-30.0, 60.0, 300.0])
@pytest.mark.parametrize("state", [State.BOOT, State.HOLD])
def test_whoever_moves_while_nobody_is_engaged_is_stopped_within_50_ms(
    make_rig: MakeRig, state: State, rate_deg_s: float
) -> None:
    rig = make_rig()
    if state is State.BOOT:
        rig.encoder_valid[0] = False  # it waits for another joint's encoder
        rig.step()
    else:
        rig.to_leased().run(0.6)
    assert run_away(rig, rate_deg_s) <= 0.05


def stopped_after_s(rig: Any, state: State, rate_deg_s: float, wander_rad_s: float) -> float:
    """An elbow runs away in a robot that moves: seconds from when that is evident until it is stopped."""
    if state is State.ALIGN:
        rig.target = rig.target + 0.8  # so that it has not arrived
    rig.to(state).run(0.1)
    began_ns, begins_rad = rig.now_ns, rig.measured[ELBOW]
    rig.lies[ELBOW] = lambda _: float(begins_rad + math.radians(rate_deg_s) * (rig.now_ns - began_ns) * 1e-9)
    evident_ns = 0
    for i in range(200):
        rig.target = rig.target + wander_rad_s * 0.005
        if i % 16 == 0:
            rig.send()
        rig.step()
        lately = [setpoint.position_rad[ELBOW] for setpoint in rig.setpoints[-22:-1]]
        shown = rig.shown()[ELBOW]
        if not evident_ns and max(min(lately) - shown, shown - max(lately)) > ASTRAY_RAD:
            evident_ns = rig.now_ns
        if rig.guard.state is State.ESTOP:
            assert "against its setpoint" in rig.guard.reason
            return float(rig.now_ns - evident_ns) / 1e9
        assert rig.guard.state in (State.ALIGN, State.TRACK)
    return math.inf


@pytest.mark.parametrize("rate_deg_s", [-300.0, -30.0, 60.0, 300.0])
@pytest.mark.parametrize("wander_rad_s", [0.0, -0.3])
@pytest.mark.parametrize("state", [State.ALIGN, State.TRACK])
def test_motion_against_the_setpoint_stops_within_50_ms(
    make_rig: MakeRig, state: State, rate_deg_s: float, wander_rad_s: float
) -> None:
    assert 0.0 <= stopped_after_s(make_rig(), state, rate_deg_s, wander_rad_s) <= 0.05


def test_without_the_patience_s_end_it_would_run_on(
    make_rig: MakeRig, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(UncommandedMotion, "_for_long", lambda self, *_: np.zeros(len(self._names), np.bool_))
    assert stopped_after_s(make_rig(), State.TRACK, 60.0, 0.0) == math.inf


def sag(rig: Any, by_rad: float, within_s: float) -> None:
    """An arm takes up a load: it sags ever more slowly."""
    rig.to_track()
    began_ns = rig.now_ns
    rig.lies[ELBOW] = lambda true: (
        true - by_rad * (1.0 - math.exp(-(rig.now_ns - began_ns) * 1e-9 / within_s))
    )
    rig.run(2.0)


@pytest.mark.parametrize("within_s", [0.02, 0.1, 0.5])
def test_an_arm_that_sags_under_a_load_while_it_follows_is_not_stopped(
    make_rig: MakeRig, within_s: float
) -> None:
    rig = make_rig()
    sag(rig, 0.99 * ASTRAY_RAD, within_s)
    assert rig.guard.state is State.TRACK
    assert not rig.guard.counters.losses


def test_called_settled_too_early_a_sagging_arm_would_be_stopped(
    make_rig: MakeRig, monkeypatch: pytest.MonkeyPatch
) -> None:
    judge = UncommandedMotion.judge
    monkeypatch.setattr(UncommandedMotion, "judge", lambda *args, **_: judge(*args))
    rig = make_rig()
    rig.to_track().run(0.5)
    began_ns = rig.now_ns
    rig.lies[ELBOW] = lambda true: true - min(0.05, 0.5e-9 * (rig.now_ns - began_ns))
    rig.run(0.3)
    assert rig.guard.state is State.ESTOP


def out_for(ms: int, width_rad: float, lately_ms: int = 0) -> bool:
    """Whether a wrist that goes outwards for so long is called against its setpoint.

    `width_rad`: of the arm's setpoint, until `lately_ms` before.
    """
    part = UncommandedMotion(["arm", "wrist"], readings=READINGS, patience=PATIENCE)
    both, zeros = np.ones(2, np.bool_), np.zeros(2)
    fast = np.array([width_rad, 0.0])
    part.judge(NS_PER_MS, (zeros, fast), zeros, both)
    begins_ns = (1 + lately_ms) * NS_PER_MS
    out = False
    for i in range(ms + 1):
        arm_is = (zeros, zeros + [0.01, 0.0])
        wrist = np.array([0.0, ASTRAY_RAD + 1e-9 + 0.002 * i])
        out |= bool(part.judge(begins_ns + i * NS_PER_MS, arm_is, wrist, both)[1])
    return out


@pytest.mark.parametrize(
    ("width_rad", "lately_ms", "may_ns"),
    [
        (SHAKES_RAD - 1e-9, 1, PATIENCE.plain_ns),
        (SHAKES_RAD + 1e-9, 1, PATIENCE.shaken_ns),
        (SHAKES_RAD + 1e-9, SHAKEN_NS // NS_PER_MS, PATIENCE.plain_ns),
    ],
)
def test_a_joint_thrown_by_others_is_given_longer_and_no_more(
    width_rad: float, lately_ms: int, may_ns: int
) -> None:
    # the first reading beyond may be the second one outwards
    ms = may_ns // NS_PER_MS
    assert not out_for(ms - 1, width_rad, lately_ms)
    assert out_for(ms + 1, width_rad, lately_ms)


def test_no_joint_is_thrown_by_itself() -> None:
    part = UncommandedMotion(["a"], readings=READINGS, patience=PATIENCE)
    low, high = np.zeros(1), np.full(1, 2.0 * SHAKES_RAD)
    out = [
        part.judge(i * NS_PER_MS, (low, high), high + ASTRAY_RAD + 0.002 * i, ONE)[0] for i in range(1, 30)
    ]
    assert any(out)


def test_the_setpoint_is_seated_where_the_drives_say_and_does_not_walk(make_rig: MakeRig) -> None:
    rig = make_rig()
    rig.coupled = False
    rig.drive_off_rad = np.full(rig.joints, 0.03)
    rig.step()
    rig.to_hold()
    assert np.array_equal(rig.setpoints[-1].position_rad, rig.measured + 0.03)


def test_a_robot_whose_drive_and_encoder_differ_is_held_nowhere(make_rig: MakeRig) -> None:
    rig = make_rig()
    rig.drive_off_rad = np.zeros(rig.joints)
    rig.drive_off_rad[ELBOW] = -math.radians(40.0)
    for _ in range(100):
        # the first reading is forgiven, as a bit may flip: it must not be what the robot is seated by
        assert not rig.step().ready
    assert rig.guard.state is State.BOOT
    assert "its output encoder" in rig.guard.reason


@pytest.mark.parametrize("sign", [1, -1])
def test_at_the_window_they_agree_and_just_beyond_they_do_not(sign: int) -> None:
    for off, apart in ((WINDOW_RAD - 1e-9, False), (WINDOW_RAD + 1e-9, True)):
        part = EncoderAgreement(["a"])
        for _ in range(3):
            said = part.judge(np.array([sign * off]), np.zeros(1), ONE)
        assert said[0] == apart
    assert list(part.words) == ["a"]
    part.judge(np.zeros(1), np.zeros(1), ONE)
    assert not part.words


def test_an_angle_that_is_no_number_does_not_agree() -> None:
    part = EncoderAgreement(["a"])
    for _ in range(2):
        said = part.judge(np.array([math.nan]), np.zeros(1), ONE)
    assert said[0]


@pytest.mark.parametrize("off_rad", [0.99 * STILL_RAD, 1.01 * STILL_RAD])
def test_a_joint_that_stands_may_move_by_less_than_the_window(off_rad: float) -> None:
    part = UncommandedMotion(["a"])
    part.begin(0, ONE, np.zeros(1))
    still = np.zeros(1), np.zeros(1)
    assert not part.judge(TICK, still, np.zeros(1), ONE)[0]
    assert part.judge(2 * TICK, still, np.array([off_rad]), ONE)[0] == (off_rad > STILL_RAD)


def test_a_slow_sag_is_not_moving_and_a_faster_creep_is() -> None:
    for rate_deg_s, moves in ((0.2, False), (1.0, True)):
        part = UncommandedMotion(["a"])
        part.begin(0, ONE, np.zeros(1))
        seen = [
            part.judge(i * TICK, (np.zeros(1), np.zeros(1)), np.radians([rate_deg_s * i * 0.005]), ONE)[0]
            for i in range(1, 600)
        ]
        assert any(seen) == moves


def test_a_joint_that_is_shaken_by_one_that_moves_is_not_called_moving() -> None:
    part = UncommandedMotion(["stands", "moves"])
    both = np.ones(2, np.bool_)
    part.begin(0, both, np.zeros(2))
    for i in range(1, 400):
        high = np.array([0.0, 0.01 * i])
        shaken = np.array([0.9 * ASTRAY_RAD * math.sin(0.1 * i), 0.01 * i])
        assert not part.judge(i * TICK, (high - [0.0, 0.2], high), shaken, both).any()


def test_a_joint_that_lags_within_the_span_is_not_against() -> None:
    part = UncommandedMotion(["a"])
    for i in range(1, 400):
        high = 0.01 * i
        span = np.array([high - 0.2]), np.array([high])
        behind = np.array([high - 0.2 - 0.9 * ASTRAY_RAD])
        assert not part.judge(i * TICK, span, behind, ONE)[0]


# where a joint's angle is read by nothing but its servo


def test_without_a_last_known_position_a_person_confirms(make_rig: MakeRig) -> None:
    rig = make_rig(None, last_known_rad=dict.fromkeys(make_rig().skeleton.joint_names, np.nan))
    for _ in range(10):
        assert not rig.step().ready
    assert rig.guard.state is State.BOOT
    assert "`tandem home`" in rig.guard.reason
    assert "left_elbow_pitch reads" in rig.guard.reason
    assert "no earlier angle known" in rig.guard.reason
    assert not rig.ask(Action.HOME, key="wrong").done
    assert not rig.ask(Action.HOME, key=KEY, challenge=1).done
    rig.step()
    assert rig.guard.state is State.BOOT
    assert rig.ask(Action.HOME, key=KEY).done
    rig.step()
    assert rig.guard.state is State.HOLD
    assert not rig.ask(Action.HOME, key=KEY).done


@pytest.mark.parametrize("sign", [1, -1])
def test_near_the_last_known_position_nobody_is_asked(make_rig: MakeRig, sign: int) -> None:
    for off, asked in ((NEAR_RAD - 1e-9, False), (NEAR_RAD + 1e-9, True)):
        rig = make_rig()
        known = dict(zip(rig.skeleton.joint_names, rig.measured.tolist(), strict=True))
        known["neck_yaw"] += sign * off
        rig = make_rig(None, last_known_rad=known)
        rig.step()
        assert (rig.guard.state is State.BOOT) == asked


@pytest.mark.parametrize("sign", [1, -1])
def test_a_little_beyond_its_range_a_joint_is_held_far_beyond_not(make_rig: MakeRig, sign: int) -> None:
    for beyond, held in ((BEYOND_RAD - 1e-9, True), (BEYOND_RAD + 1e-9, False)):
        rig = make_rig()
        rig.measured = rig.measured.copy()
        end = rig.skeleton.upper_rad if sign > 0 else rig.skeleton.lower_rad
        rig.measured[ELBOW] = end[ELBOW] + sign * beyond
        assert rig.step().ready == held
