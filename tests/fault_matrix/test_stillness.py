"""The measurement itself, on courses whose figures are known."""

from __future__ import annotations

import numpy as np
import pytest

from common.quaternion import Array
from common.skeleton import load_skeleton
from deploy.harness.faults.judge import Asked, asked_beyond, moved_beyond
from deploy.measure.stillness import SPEED_ERROR_RAD_S, STILL_RAD, StoppingMotion, stillness
from slave.encoders.counts import RAD_PER_COUNT

SKELETON = load_skeleton("nursing")
JOINTS = len(SKELETON.joints)
AT_S = np.arange(-0.2, 2.0, 0.005)
ALL = np.ones(JOINTS, np.bool_)


def course(joint: int, position_rad: Array, asked_rad: float) -> StoppingMotion:
    encoder = np.zeros((len(AT_S), JOINTS))
    encoder[:, joint] = np.rint(position_rad / RAD_PER_COUNT) * RAD_PER_COUNT
    setpoint = np.zeros_like(encoder)
    setpoint[:, joint] = asked_rad
    return StoppingMotion(AT_S, setpoint, encoder)


def test_a_joint_that_runs_on_for_a_while() -> None:
    """1 rad/s until 0.3 s after the fault, asked to stop at 0.25 rad."""
    seen = stillness(course(4, np.minimum(AT_S, 0.3), 0.25), SKELETON, ALL)
    assert seen.peak_joint == SKELETON.joint_names[4]
    assert seen.peak_speed_rad_s == pytest.approx(1.0, abs=SPEED_ERROR_RAD_S)
    assert seen.way_rad == pytest.approx(0.3, abs=RAD_PER_COUNT)
    assert seen.overshoot_rad == pytest.approx(0.05, abs=RAD_PER_COUNT)
    # still from when on it is within the band about its end
    assert seen.standstill_s == pytest.approx(0.3 - STILL_RAD, abs=0.006)


def test_a_joint_that_creeps_on_does_not_stand() -> None:
    assert stillness(course(4, 0.05 * AT_S, 0.0), SKELETON, ALL).standstill_s is None


def test_flicker_of_a_count_is_standing() -> None:
    flicker = RAD_PER_COUNT * (np.arange(float(len(AT_S))) % 2)
    assert stillness(course(4, flicker, 0.0), SKELETON, ALL).standstill_s == pytest.approx(0.0, abs=0.006)


def test_joints_not_concerned_are_not_judged() -> None:
    others = ALL.copy()
    others[4] = False
    seen = stillness(course(4, AT_S, 0.0), SKELETON, others)
    assert seen.way_rad == 0.0
    assert seen.standstill_s == pytest.approx(0.0, abs=0.006)


def test_encoders_beyond_a_limit_are_named() -> None:
    fastest = SKELETON.max_velocity_rad_s[4]
    within = course(4, 0.3 * np.clip(AT_S / 0.3 * fastest, 0.0, 1.0), 0.0)
    assert moved_beyond(within, SKELETON) == []
    too_fast = course(4, 0.3 * np.clip(AT_S / 0.3 * 1.2 * fastest, 0.0, 1.0), 0.0)
    assert any("speed of left_shoulder_roll" in word for word in moved_beyond(too_fast, SKELETON))
    too_far = course(4, np.full(len(AT_S), SKELETON.upper_rad[4] + 0.1), 0.0)
    assert any("position of left_shoulder_roll" in word for word in moved_beyond(too_far, SKELETON))


@pytest.mark.parametrize(
    ("position", "velocity", "word"),
    [(0.0, 0.0, None), (9.0, 0.0, "position"), (1.0, 0.0, "speed"), (0.0, 9.0, "acceleration")],
)
def test_setpoints_beyond_a_limit_are_named(position: float, velocity: float, word: str | None) -> None:
    positions, velocities = np.zeros((3, JOINTS)), np.zeros((3, JOINTS))
    middle = 0.5 * (SKELETON.lower_rad + SKELETON.upper_rad)
    positions[2, 4], velocities[2, 4] = position, velocity
    words = asked_beyond(Asked(np.full(2, 0.005), positions + middle, velocities), SKELETON)
    assert not words if word is None else any(word in said for said in words)
