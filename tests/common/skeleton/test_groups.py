"""Joint groups come from the tree: an arm has its hand, the trunk has its own joints alone."""

from __future__ import annotations

import numpy as np
import pytest

from common.skeleton import load_skeleton
from common.skeleton.groups import joint_groups
from common.skeleton.load import parse_skeleton, profile_names

HANGING = """
name = "hanging"
[[segment]]
name = "chest"
parent = "world"
axes = "z y x"
angles = "_ waist _"
origin_m = [0.0, 0.0, 1.0]
node_m = [0.0, 0.0, 0.1]
[[segment]]
name = "arm"
parent = "chest"
axes = "x y z"
angles = "shoulder _ _"
origin_m = [0.0, 0.0, 0.4]
node_m = [0.0, 0.0, 0.1]
[[segment]]
name = "forearm"
parent = "arm"
axes = "x y z"
angles = "elbow _ _"
origin_m = [0.0, 0.0, 0.4]
node_m = [0.0, 0.0, 0.1]
"""
JOINT = """
[[joint]]
name = "{name}"
lower_deg = -10.0
upper_deg = 10.0
max_velocity_deg_s = 90.0
max_acceleration_deg_s2 = 1000.0
"""


def named(profile: str, group: str) -> list[str]:
    skeleton = load_skeleton(profile)
    return [skeleton.joint_names[j] for j in np.flatnonzero(joint_groups(skeleton)[group])]


def test_the_nursing_robot_has_arms_with_hands_a_head_and_a_trunk() -> None:
    groups = joint_groups(load_skeleton("nursing"))
    assert list(groups) == ["trunk", "head", "left_arm", "left_hand", "right_arm", "right_hand"]
    assert named("nursing", "trunk") == ["waist_pitch"]
    assert named("nursing", "head") == ["neck_yaw", "neck_pitch"]
    assert len(named("nursing", "left_arm")) == 11
    assert all(name.startswith("left_") for name in named("nursing", "left_arm"))
    assert len(named("nursing", "left_hand")) == 6
    assert set(named("nursing", "left_hand")) < set(named("nursing", "left_arm"))


@pytest.mark.parametrize("profile", profile_names())
def test_every_joint_of_every_profile_is_in_a_group(profile: str) -> None:
    assert np.logical_or.reduce(list(joint_groups(load_skeleton(profile)).values())).all()


def test_a_table_that_names_no_group_has_them_by_its_tree() -> None:
    text = HANGING + "".join(JOINT.format(name=name) for name in ("waist", "shoulder", "elbow"))
    groups = joint_groups(parse_skeleton(text, "hanging.toml"))
    assert {name: joints.tolist() for name, joints in groups.items()} == {
        "chest": [True, False, False],
        "arm": [False, True, True],
    }
