from __future__ import annotations

import numpy as np
import pytest

from common.errors import ConfigError
from common.quaternion import Array
from common.skeleton import Skeleton, load_skeleton
from deploy.sim.suit.motion import MOTIONS, STILL_S, OperatorMotion, load_motion, parse_motion

STEP_S = 0.002


def sampled(motion: OperatorMotion) -> tuple[Array, Array, Array]:
    return motion.state(np.arange(0.0, motion.period_s, STEP_S))


PROFILES = ("nursing", "hand", "lower_limb")
MADE = {name: only for name, only in MOTIONS.items() if name != "capture"}
"""`capture` is of real people, who keep no robot's limits: test_people.py."""


@pytest.fixture(
    scope="module",
    params=[(name, profile) for name, only in MADE.items() for profile in ([only] if only else PROFILES)],
    ids=" ".join,
)
def moved(request: pytest.FixtureRequest) -> tuple[OperatorMotion, Skeleton]:
    name, profile = request.param
    return load_motion(name, load_skeleton(profile)), load_skeleton(profile)


@pytest.fixture(scope="module")
def bottle(skeleton: Skeleton) -> OperatorMotion:
    return load_motion("bottle", skeleton)


def test_every_motion_stays_within_all_limits(moved: tuple[OperatorMotion, Skeleton]) -> None:
    motion, skeleton = moved
    position, velocity, acceleration = sampled(motion)
    assert (position >= skeleton.lower_rad - 1e-9).all()
    assert (position <= skeleton.upper_rad + 1e-9).all()
    assert (np.abs(velocity) <= 0.85 * skeleton.max_velocity_rad_s).all()
    assert (np.abs(acceleration) <= 0.5 * skeleton.max_acceleration_rad_s2).all()


def test_every_motion_is_smooth_at_its_seam(moved: tuple[OperatorMotion, Skeleton]) -> None:
    motion, _ = moved
    end, begin = motion.state(motion.period_s - 1e-9), motion.state(motion.period_s + 1e-9)
    for left, right in zip(end, begin, strict=True):
        np.testing.assert_allclose(left, right, atol=1e-5)


def test_the_calibration_pose_is_the_zero_pose(skeleton: Skeleton) -> None:
    position, velocity, acceleration = load_motion("calibration_pose", skeleton).state(12.3)
    for values in (position, velocity, acceleration):
        np.testing.assert_array_equal(values, 0.0)


def test_the_sweep_takes_each_joint_to_one_degree_inside_its_limits(skeleton: Skeleton) -> None:
    position, velocity, _ = sampled(load_motion("sweep", skeleton))
    np.testing.assert_allclose(position.max(axis=0), skeleton.upper_rad - np.radians(1.0), atol=1e-6)
    np.testing.assert_allclose(position.min(axis=0), skeleton.lower_rad + np.radians(1.0), atol=1e-6)
    assert (np.sum(np.abs(velocity) > 0.0, axis=1) <= 1).all()
    still = sampled(load_motion("sweep", skeleton))[1][: int(STILL_S / STEP_S)]
    np.testing.assert_array_equal(still, 0.0)


def test_the_bottle_begins_with_three_seconds_of_standing_near_zero(bottle: OperatorMotion) -> None:
    position, velocity, _ = bottle.state(np.arange(0.0, 3.0, STEP_S))
    np.testing.assert_array_equal(velocity, 0.0)
    assert np.degrees(np.abs(position)).max() < 15.0


def test_in_the_bottle_every_joint_takes_part(bottle: OperatorMotion, skeleton: Skeleton) -> None:
    position, _, _ = sampled(bottle)
    travel = dict(zip(skeleton.joint_names, np.degrees(np.ptp(position, axis=0)), strict=True))
    assert min(travel.values()) > 10.0, travel
    assert min(travel[f"right_{f}"] for f in ("index", "middle", "ring", "little")) > 40.0


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize("joint", ["shoulder_pitch", "shoulder_roll", "shoulder_yaw"])
def test_the_bottles_fast_phases_are_those_of_the_papers_table_1(
    bottle: OperatorMotion, skeleton: Skeleton, side: str, joint: str
) -> None:
    """Paper A, Table 1: the shoulder's angles change 4.02 to 4.94 degrees an 80 ms step on average."""
    j = skeleton.joint_names.index(f"{side}_{joint}")
    t_s = np.arange(0.0, bottle.period_s, STEP_S)
    position, velocity, _ = (values[:, j] for values in bottle.state(t_s))
    fast = np.abs(velocity) > 0.5 * np.abs(velocity).max()
    change = np.abs(bottle.state(t_s + 0.08)[0][:, j] - position)[fast]
    assert 4.0 <= np.degrees(change.mean()) <= 5.0


def test_the_bottles_joints_do_not_start_in_step(bottle: OperatorMotion) -> None:
    _, velocity, _ = sampled(bottle)
    first = np.argmax(np.abs(velocity) > 0.0, axis=0)
    assert len(set(first.tolist())) >= 8


def test_an_unknown_motion_is_refused_with_the_names_there_are(skeleton: Skeleton) -> None:
    with pytest.raises(
        ConfigError,
        match="motion = 'dance': expected one of bottle, crossed, calibration_pose, sweep, postures,",
    ):
        load_motion("dance", skeleton)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("tail_wag = 5", "move.0.to_deg.tail_wag = 5: expected a joint of the skeleton nursing"),
        ("neck_yaw = 71", "move.0.to_deg.neck_yaw = 71: expected -70 to 70"),
        ("neck_yaw = 30", "neck_yaw: its last move does not return"),
    ],
)
def test_a_motion_the_skeleton_cannot_make_is_refused(skeleton: Skeleton, text: str, said: str) -> None:
    motion = f"period_s = 3.0\n[rest_deg]\n[[move]]\nstart_s = 1.0\nduration_s = 1.0\nto_deg = {{ {text} }}"
    with pytest.raises(ConfigError, match=said):
        parse_motion(motion, skeleton, source="wave.toml")


@pytest.mark.parametrize(
    ("name", "profile", "able"),
    [
        ("bottle", "hand", "grasp, calibration_pose, sweep, postures, move_joints, tray, calibration"),
        (
            "grasp",
            "nursing",
            "bottle, crossed, calibration_pose, sweep, postures, move_joints, tray, calibration, capture",
        ),
        ("dance", "lower_limb", "walk, calibration_pose, sweep, postures, move_joints, tray, calibration"),
    ],
)
def test_a_motion_of_another_profile_is_one_line(name: str, profile: str, able: str) -> None:
    with pytest.raises(
        ConfigError, match=f"^motion: motion = '{name}': expected one of {able} for the profile {profile}$"
    ):
        load_motion(name, load_skeleton(profile))
