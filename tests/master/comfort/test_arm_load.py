"""Raised and held arms are timed by gravity alone, and told when the published limits are passed."""

from __future__ import annotations

import numpy as np
import pytest

from common.clock import to_ns
from common.quaternion import Array, from_axis_angle, heading_turn, multiply
from common.skeleton import load_skeleton
from common.skeleton.kinematics import orientations
from master.comfort.arm_load import ArmLoadMeter, holding_limit_s

NURSING = load_skeleton("nursing")
ALL = np.ones(len(NURSING.segments), np.bool_)
PERIOD_S = 0.08


def posture(facing_deg: float = 0.0, **joints_deg: float) -> Array:
    angles = np.radians([joints_deg.get(name, 0.0) for name in NURSING.joint_names])
    return multiply(heading_turn(np.radians(facing_deg)), orientations(NURSING, angles))


class Shift:
    def __init__(self) -> None:
        self.meter = ArmLoadMeter(NURSING)
        self.now_s = 1000.0

    def run(self, seconds: float, q: Array, known: np.ndarray = ALL) -> list[str]:
        said = []
        for _ in range(round(seconds / PERIOD_S)):
            self.now_s += PERIOD_S
            said += self.meter.take(to_ns(self.now_s), q, known)
        return said

    def raised_s(self, arm: str) -> float:
        return self.meter.metrics()[arm].raised_s


@pytest.fixture
def shift() -> Shift:
    return Shift()


@pytest.mark.parametrize("facing_deg", [0.0, 137.0])
@pytest.mark.parametrize(
    ("joints", "raised"),
    [
        ({"left_shoulder_pitch": 59.0}, False),
        ({"left_shoulder_pitch": 61.0}, True),
        ({"left_shoulder_roll": 61.0}, True),
        ({"left_shoulder_pitch": 45.0, "left_elbow_pitch": 60.0}, False),
        ({"left_shoulder_pitch": 50.0, "left_elbow_pitch": 120.0}, True),  # the hand is above the shoulder
    ],
)
def test_an_arm_is_raised_by_its_elevation_or_its_hand(
    shift: Shift, joints: dict[str, float], raised: bool, facing_deg: float
) -> None:
    shift.run(10.0 * PERIOD_S, posture(facing_deg, **joints))
    assert shift.raised_s("left_arm") == pytest.approx(9 * PERIOD_S if raised else 0.0, abs=0.06)
    assert shift.raised_s("right_arm") == 0.0


def test_more_than_a_tenth_of_the_last_quarter_is_told_once_in_a_while(shift: Shift) -> None:
    up, down = posture(right_shoulder_pitch=80.0), posture()
    assert [line for line in shift.run(59.0, up) if "raised" in line] == []
    shift.run(60.0, down)
    assert [line for line in shift.run(29.0, up) if "raised" in line] == []
    shift.run(60.0, down)
    (line,) = [line for line in shift.run(5.0, up) if "raised" in line]
    assert line == "right_arm raised for 1.5 of the last 15 min: let it rest (tandem rest right_arm)"
    assert shift.run(100.0, down) == []


def test_after_a_quarter_of_an_hour_at_rest_it_has_faded(shift: Shift) -> None:
    shift.run(60.0, posture(right_shoulder_pitch=80.0))
    shift.run(890.0, posture())
    assert 0.0 < shift.raised_s("right_arm") < 60.0
    shift.run(20.0, posture())
    assert shift.raised_s("right_arm") == 0.0


def test_the_holding_time_falls_from_three_minutes_at_20_to_one_at_60_degrees() -> None:
    assert [holding_limit_s(deg) for deg in (19.9, 20.0, 40.0, 60.0, 90.0)] == [
        float("inf"), 180.0, 120.0, 60.0, 60.0,
    ]  # fmt: skip


def test_an_arm_that_is_held_too_long_is_told_and_one_that_moves_is_not(shift: Shift) -> None:
    at_40 = posture(left_shoulder_pitch=40.0)
    assert shift.run(119.0, at_40) == []
    (line,) = shift.run(3.0, at_40)
    assert line == "left_arm held at 40° for 2.0 min: let it rest (tandem rest left_arm)"
    other = Shift()
    for _ in range(5):
        assert other.run(60.0, at_40) == []
        assert other.run(1.0, posture(left_shoulder_pitch=25.0)) == []


def test_hanging_arms_are_never_held(shift: Shift) -> None:
    assert shift.run(300.0, posture()) == []


def test_what_is_not_seen_does_not_count(shift: Shift) -> None:
    up = posture(left_shoulder_pitch=40.0)
    lost = ALL.copy()
    lost[NURSING.segment_names.index("left_upper_arm")] = False
    shift.run(100.0, up)
    shift.run(60.0, up, lost)
    assert shift.run(100.0, up) == []
    before = shift.raised_s("left_arm")
    shift.now_s += 500.0  # the process stalled
    shift.run(PERIOD_S, posture(left_shoulder_pitch=80.0))
    assert shift.raised_s("left_arm") == before


def test_a_bowed_trunk_counts_as_gravity_sees_it(shift: Shift) -> None:
    bowed = multiply(from_axis_angle([0.0, 1.0, 0.0], np.radians(70.0)), posture())
    shift.run(10.0 * PERIOD_S, bowed)
    assert shift.raised_s("left_arm") > 0.5


def test_legs_and_a_hand_alone_have_no_arms() -> None:
    for profile in ("lower_limb", "hand"):
        skeleton = load_skeleton(profile)
        count = len(skeleton.segments)
        meter = ArmLoadMeter(skeleton)
        assert meter.take(1, heading_turn(np.zeros(count)), np.ones(count, np.bool_)) == []
        assert meter.metrics() == {}
