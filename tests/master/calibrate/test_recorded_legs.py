"""The real person's legs: sensors askew, no magnetometer; they sit, stand and jog for 100 s."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from common.quaternion import Array, conjugate, rotate
from common.skeleton import load_skeleton
from common.skeleton.full_body import RECORDED_AS
from master.calibrate.alignment import find_alignment, posture
from master.calibrate.oriented import orient
from master.calibrate.recording import load_recordings
from master.joint_angles.decomposition import JointAngles
from master.orientation.hinge_angle import HingeAngle, HingeAngleConfig, hinge_of

pytestmark = pytest.mark.long
LEGS = load_skeleton("lower_limb")
SIDES = ("left", "right")

# degrees; what the American Academy of Orthopaedic Surgeons gives as a healthy joint's range, and 10° more
# either way for skin and for a zero pose that is only nearly one
POSSIBLE = {
    "hip_flexion": (-40.0, 130.0),
    "hip_abduction": (-40.0, 55.0),
    "hip_rotation": (-55.0, 55.0),
    "knee_flexion": (-15.0, 145.0),
    "ankle_flexion": (-60.0, 35.0),
}
FASTEST_DEG_S = {"hip_flexion": 900.0, "hip_abduction": 900.0, "knee_flexion": 900.0, "ankle_flexion": 900.0}
"""A sprinter's knee reaches 1000 °/s, this person jogs. The hip's rotation is left out: it is what shakes
with the skin of the thigh, 1500 °/s at each step."""


@dataclass(frozen=True)
class Person:
    rate_hz: float
    angles_deg: dict[str, Array]
    rates_deg_s: dict[str, Array]
    knees_by_hinge_deg: Array


@pytest.fixture(scope="module")
def person(real_person: Path) -> Person:
    file = load_recordings(real_person)
    recordings = {name: file[RECORDED_AS[name]] for name in LEGS.segment_names}
    alignment = find_alignment(recordings, LEGS)
    assert alignment.refused == {}
    suit = orient(recordings, LEGS.segment_names)
    q_sensor_from_segment = np.array([alignment.nodes[n].q_sensor_from_segment for n in LEGS.segment_names])
    gyr, acc = (
        np.stack(list(r), axis=1)
        for r in zip(*((r.gyr_rad_s, r.acc_m_s2) for r in recordings.values()), strict=True)
    )
    rates = rotate(conjugate(q_sensor_from_segment), gyr)
    solver = JointAngles(LEGS)
    solved = np.degrees([solver.solve(*tick) for tick in zip(posture(suit, alignment), rates, strict=True)])
    hinge = hinge_of(LEGS, ["left_shank", "right_shank"], q_sensor_from_segment)
    online = HingeAngle(HingeAngleConfig(), hinge, suit.rate_hz)
    near, far = [1, 4], [2, 5]
    by_hinge = [online.update(g[near], a[near], g[far], a[far]) for g, a in zip(gyr, acc, strict=True)]
    return Person(
        suit.rate_hz,
        dict(zip(LEGS.joint_names, solved[:, 0].T, strict=True)),
        dict(zip(LEGS.joint_names, solved[:, 1].T, strict=True)),
        np.degrees(by_hinge),
    )


@pytest.mark.parametrize("joint", POSSIBLE)
def test_every_angle_is_one_that_a_person_has(person: Person, joint: str) -> None:
    lower, upper = POSSIBLE[joint]
    for side in SIDES:
        angle = person.angles_deg[f"{side}_{joint}"]
        assert lower < angle.min() < angle.max() < upper


@pytest.mark.parametrize("side", SIDES)
def test_knees_bend_the_right_way(person: Person, side: str) -> None:
    angle = person.angles_deg[f"{side}_knee_flexion"]
    assert angle.max() > 90.0
    assert np.percentile(angle, 1.0) > -5.0


@pytest.mark.parametrize("joint", FASTEST_DEG_S)
def test_no_joint_jumps(person: Person, joint: str) -> None:
    for side in SIDES:
        angle, rate = person.angles_deg[f"{side}_{joint}"], person.rates_deg_s[f"{side}_{joint}"]
        assert np.abs(np.diff(angle)).max() * person.rate_hz < FASTEST_DEG_S[joint]
        assert np.abs(rate).max() < FASTEST_DEG_S[joint]


def test_sitting_hips_and_knees_are_bent_standing_straight(person: Person) -> None:
    at = {name: angle[[2500, 100]] for name, angle in person.angles_deg.items()}
    for side in SIDES:
        assert 70.0 < at[f"{side}_knee_flexion"][0] < 100.0
        assert 45.0 < at[f"{side}_hip_flexion"][0] < 90.0
        assert abs(at[f"{side}_knee_flexion"][1]) < 3.0
        assert abs(at[f"{side}_hip_flexion"][1]) < 3.0


def test_left_and_right_jog_alike_half_a_stride_apart(person: Person) -> None:
    jog = slice(6000, 9500)
    left, right = (person.angles_deg[f"{side}_knee_flexion"][jog] for side in SIDES)
    assert abs(np.percentile(left, 98) - np.percentile(right, 98)) < 12.0
    assert np.corrcoef(left, right)[0, 1] < 0.0
    hips = [person.angles_deg[f"{side}_hip_flexion"][jog] for side in SIDES]
    assert np.corrcoef(hips[0], hips[1])[0, 1] < -0.7


@pytest.mark.parametrize("k", range(2))
def test_the_hinge_angle_and_the_solver_agree_on_the_knee(person: Person, k: int) -> None:
    """Two ways that share the readings and the axes only; one has both orientations, the other neither."""
    solver = person.angles_deg[f"{SIDES[k]}_knee_flexion"]
    assert np.sqrt(np.mean((person.knees_by_hinge_deg[:, k] - solver) ** 2)) < 4.0
