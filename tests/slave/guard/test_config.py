"""Mistakes in `[guard]`: one clear line each."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from common.config.load import check_config
from common.errors import ConfigError
from common.skeleton import load_skeleton
from slave.guard import Guard, GuardConfig

SKELETON = load_skeleton("nursing")


def lines(table: dict[str, Any]) -> list[str]:
    config = check_config(Path("slave.toml"), table, GuardConfig)
    return [f"{m.key} = {m.value!r}: {m.expected}" for m in config.mistakes_for(SKELETON)]


def test_the_defaults_are_sound() -> None:
    assert lines({}) == []
    limits = GuardConfig().limits(SKELETON)
    assert np.array_equal(limits.upper_rad, SKELETON.upper_rad)
    assert np.array_equal(limits.max_acceleration_rad_s2, SKELETON.max_acceleration_rad_s2)


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("max_age_s", 0.0),
        ("max_age_s", -1.0),
        ("max_age_s", float("nan")),
        ("max_age_s", float("inf")),
        ("command_timeout_s", 0),
        ("command_timeout_s", "0.2"),
        ("command_timeout_s", True),
        ("encoder_timeout_s", 60.0),
        ("future_tolerance_s", -0.001),
        ("align_velocity_rad_s", 50.0),
        ("velocity_scale", 1.0001),
        ("acceleration_scale", 0.0),
        ("events_kept", 0),
        ("events_kept", 2.5),
        ("max_step_s", 1.0),
        ("reset_key", 12345),
        ("lease_timeout", 1.0),
        ("joints", {"neck_yaw": {"upper": 3.0}}),
        ("joints", {"neck_yaw": {"upper_deg": float("nan")}}),
    ],
)
def test_an_impossible_value_names_its_key(key: str, value: object) -> None:
    with pytest.raises(ConfigError) as caught:
        check_config(Path("slave.toml"), {key: value}, GuardConfig)
    (line,) = str(caught.value).splitlines()
    assert line.startswith(f"slave.toml: {key}")
    assert "expected" in line


@pytest.mark.parametrize(
    ("table", "line"),
    [
        ({"command_timeout_s": 1.5}, "guard.lease_timeout_s = 1.0: at least command_timeout_s, 1.5"),
        (
            {"align_dwell_s": 5, "align_timeout_s": 5},
            "guard.align_timeout_s = 5.0: more than align_dwell_s, 5.0",
        ),
        (
            {"joints": {"left_elbow": {"upper_deg": 9}}},
            "guard.joints.left_elbow = {'upper_deg': 9.0}: a joint of nursing",
        ),
        (
            {"joints": {"left_elbow_pitch": {"upper_deg": 141}}},
            "guard.joints.left_elbow_pitch.upper_deg = 141.0: within the skeleton's 0 to 140",
        ),
        (
            {"joints": {"left_elbow_pitch": {"lower_deg": -1}}},
            "guard.joints.left_elbow_pitch.lower_deg = -1.0: within the skeleton's 0 to 140",
        ),
        (
            {"joints": {"left_elbow_pitch": {"lower_deg": 90, "upper_deg": 90}}},
            "guard.joints.left_elbow_pitch.lower_deg = 90.0: below upper_deg, 90",
        ),
        (
            {"joints": {"neck_yaw": {"max_velocity_deg_s": 181}}},
            "guard.joints.neck_yaw.max_velocity_deg_s = 181.0: above 0, at most the skeleton's 180",
        ),
        (
            {"joints": {"neck_yaw": {"max_acceleration_deg_s2": 0}}},
            "guard.joints.neck_yaw.max_acceleration_deg_s2 = 0.0: above 0, at most the skeleton's 2000",
        ),
    ],
)
def test_a_contradiction_or_a_looser_limit_is_one_line(table: dict[str, Any], line: str) -> None:
    assert lines(table) == [line]


def test_the_skeletons_own_values_are_not_looser() -> None:
    joints = {
        joint.name: {
            "lower_deg": float(np.rad2deg(joint.lower_rad).round(9)),
            "upper_deg": float(np.rad2deg(joint.upper_rad).round(9)),
            "max_velocity_deg_s": float(np.rad2deg(joint.max_velocity_rad_s).round(9)),
            "max_acceleration_deg_s2": float(np.rad2deg(joint.max_acceleration_rad_s2).round(9)),
        }
        for joint in SKELETON.joints
    }
    assert lines({"joints": joints}) == []


def test_single_joints_are_tightened() -> None:
    config = check_config(
        Path("slave.toml"),
        {"velocity_scale": 0.5, "joints": {"neck_yaw": {"upper_deg": 30, "max_velocity_deg_s": 90}}},
        GuardConfig,
    )
    limits = config.limits(SKELETON)
    assert limits.upper_rad[0] == np.deg2rad(30)
    assert limits.lower_rad[0] == SKELETON.lower_rad[0]
    assert limits.max_velocity_rad_s[0] == pytest.approx(np.deg2rad(45))
    assert limits.max_velocity_rad_s[1] == pytest.approx(0.5 * SKELETON.max_velocity_rad_s[1])


def test_a_guard_cannot_be_made_of_a_wrong_configuration() -> None:
    with pytest.raises(ConfigError, match=r"robot-1: guard\.lease_timeout_s"):
        Guard("robot-1", SKELETON, GuardConfig(command_timeout_s=1.5))
