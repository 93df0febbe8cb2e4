"""The page computes the robot's posture from `scene`; so does this test, and the robot's own model agrees."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from common.quaternion import from_axis_angle, multiply, rotate
from common.skeleton import load_skeleton
from deploy.console.model.scene import scene
from slave.model.body import BodyModel


def as_the_page_does(shown: dict[str, Any], position: Any) -> list[tuple[Any, Any]]:
    placed: list[tuple[Any, Any]] = []
    for link in shown["links"]:
        origin, q = placed[link["parent"]] if link["parent"] >= 0 else (np.zeros(3), np.array([1.0, 0, 0, 0]))
        origin = origin + rotate(q, np.array(link["origin_m"]))
        q = multiply(q, np.array(link["q_parent_from_link"]))
        for hinge in link["hinges"]:
            value = sum(ratio * position[j] for j, ratio in hinge["joints"])
            if hinge["slides"]:
                origin = origin + rotate(q, np.array(hinge["axis"])) * value
                continue
            turned = multiply(q, from_axis_angle(hinge["axis"], np.array(value)))
            anchor = np.array(hinge["anchor_m"])
            origin, q = origin + rotate(q, anchor) - rotate(turned, anchor), turned
        placed.append((origin, q))
    return placed


@pytest.mark.parametrize("profile", ["nursing", "hand", "lower_limb"])
def test_the_pages_kinematics_are_the_robots(profile: str) -> None:
    skeleton = load_skeleton(profile)
    shown: Any = scene(skeleton)
    rng = np.random.default_rng(1)
    body = BodyModel(skeleton)
    for _ in range(5):
        position = rng.uniform(skeleton.lower_rad, skeleton.upper_rad)
        posture = body.at(position)
        placed = as_the_page_does(shown, position)
        np.testing.assert_allclose([origin for origin, _ in placed], posture.origin_m, atol=1e-6)
        tips = [rotate(q, np.array([0.0, 0.0, 1.0])) for _, q in placed]
        np.testing.assert_allclose(tips, posture.r_base_from_segment[:, :, 2], atol=1e-6)
    assert [len(link["capsules"]) > 0 for link in shown["links"]].count(True) > 0
    assert [joint["name"] for joint in shown["joints"]] == list(skeleton.joint_names)
