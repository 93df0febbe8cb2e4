"""Below which force no push is noticed: by segment, at its boundary."""

from __future__ import annotations

import numpy as np
import pytest

from common.quaternion import Array
from common.skeleton import load_skeleton
from slave.contact.config import ContactConfig, ContactJoint
from slave.contact.least_push import least_push_n, push_words
from slave.contact.watch import ContactWatch
from slave.model.body import BodyModel
from slave.model.capsules import capsules, links

NURSING = load_skeleton("nursing")
FLOOR_NM = ContactWatch(NURSING, ContactConfig()).floor_nm
ZERO_RAD = np.clip(NURSING.zero_rad, NURSING.lower_rad, NURSING.upper_rad)
BODY = BodyModel(NURSING)


def far_end_m(segment: int, position_rad: Array) -> Array:
    ends = [np.array(one.to_m) for one in capsules(NURSING) if one.segment == segment]
    return BODY.at(position_rad).point_m(segment, max(ends, key=lambda end: float(end @ end)))


def torques_nm(segment: int, force_n: Array) -> Array:
    """(J,) of a force (3,) at the segment's far end, by virtual work over a small turn of each joint."""
    small = 1e-6
    moved = [
        far_end_m(segment, ZERO_RAD + small * row) - far_end_m(segment, ZERO_RAD - small * row)
        for row in np.eye(len(ZERO_RAD))
    ]
    return np.asarray(np.array(moved) @ force_n / (2.0 * small))


@pytest.mark.parametrize("name", ["left_hand", "right_forearm", "left_upper_arm", "head"])
def test_below_it_no_push_reaches_a_threshold_and_just_above_one_does(name: str) -> None:
    segment = [link.name for link in links(NURSING)].index(name)
    least_n = least_push_n(NURSING, FLOOR_NM)[name]
    draw = np.random.default_rng(2)
    for _ in range(30):
        direction = draw.normal(size=3)
        torque = torques_nm(segment, 0.99 * least_n * direction / np.linalg.norm(direction))
        assert (np.abs(torque) < FLOOR_NM).all()
    pushes = [np.array([torques_nm(segment, axis)[j] for axis in np.eye(3)]) for j in range(15)]
    felt = [
        abs(torques_nm(segment, 1.01 * least_n * way / np.linalg.norm(way))[j]) > FLOOR_NM[j]
        for j, way in enumerate(pushes)
        if np.linalg.norm(way) > 0.01
    ]
    assert any(felt)


def test_fingers_and_the_pelvis_are_left_out_unless_a_finger_is_named() -> None:
    least_n = least_push_n(NURSING, FLOOR_NM)
    assert "pelvis" not in least_n
    assert not [name for name in least_n if "thumb" in name or "index" in name]
    thumb = ContactConfig(joints={"left_thumb": ContactJoint(threshold_nm=0.02)})
    named = least_push_n(NURSING, ContactWatch(NURSING, thumb).floor_nm)
    assert [name for name in named if "left_thumb" in name]


def test_finer_angles_notice_less_and_the_words_say_whose() -> None:
    watch = ContactWatch(NURSING, ContactConfig())
    coarse = watch.dull
    watch._tune(drives=True)
    assert "by the output encoders no push is noticed below 3 N at left_hand, right_hand" in coarse
    assert "11 N at left_upper_arm, right_upper_arm" in coarse
    assert "by the drives' angles no push is noticed below 2 N at left_forearm, left_hand," in watch.dull
    assert "6 N at left_upper_arm, right_upper_arm" in watch.dull
    assert push_words({}, drives=True) == ""


def test_a_robot_of_which_no_joint_is_watched_has_no_such_force() -> None:
    hand = load_skeleton("hand")
    assert ContactWatch(hand, ContactConfig()).dull == ""
