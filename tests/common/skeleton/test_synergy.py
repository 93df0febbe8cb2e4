"""Fourteen angles to five joints: the hand's synergies are the nursing robot's own couplings."""

from __future__ import annotations

from importlib import resources

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from common.errors import ConfigError
from common.skeleton import load_skeleton
from common.skeleton.load import parse_skeleton
from common.skeleton.synergy import joints_from_synergies, synergies_from_joints, synergy_positions

HAND, NURSING = load_skeleton("hand"), load_skeleton("nursing")
FINGERS = ("thumb", "index", "middle", "ring", "little")
MOST = settings(max_examples=60, deadline=None, derandomize=True)


def test_the_hand_has_fifteen_nodes_and_fourteen_joints() -> None:
    assert len(HAND.segments) == 15
    assert len(HAND.joints) == 14
    assert all(joint.drives == {joint.name: 1.0} for joint in HAND.joints)
    assert set(HAND.joint_names) == set(HAND.angle_slots)


def test_it_is_nursing_s_right_glove_axis_by_axis() -> None:
    glove = {s.name: s for s in NURSING.segments}
    for segment in HAND.segments[1:]:
        theirs = glove[segment.name]
        assert (segment.parent, segment.axes, segment.angles) == (theirs.parent, theirs.axes, theirs.angles)
        assert (segment.origin_m, segment.node_m) == (theirs.origin_m, theirs.node_m)
        assert segment.human == theirs.human


def test_the_synergies_are_what_nursing_s_finger_joints_drive() -> None:
    drives = {joint.name: joint.drives for joint in NURSING.joints}
    assert {s.name: s.drives for s in HAND.synergies} == {f"right_{f}": drives[f"right_{f}"] for f in FINGERS}


def test_a_left_hand_is_its_mirror_image() -> None:
    # as the head of hand.toml says: reflected in the sagittal plane it is nursing's left glove
    left = {s.name: s for s in NURSING.segments}
    for segment in HAND.segments[1:]:
        theirs = left[segment.name.replace("right", "left")]
        assert theirs.origin_m == tuple(np.multiply(segment.origin_m, (1, -1, 1)).tolist())
        # a rotation axis is a pseudovector: the reflection turns round what lies in the plane
        flexion = tuple(np.multiply(segment.axes[0], (-1, 1, -1)).tolist())
        assert theirs.axes[0] == flexion


@MOST
@given(st.lists(st.floats(-0.5, 2.0), min_size=14, max_size=14))
def test_they_are_the_least_squares_solution(angles: list[float]) -> None:
    ratios = joints_from_synergies(HAND)
    best, *_ = np.linalg.lstsq(ratios, np.array(angles), rcond=None)
    np.testing.assert_allclose(synergy_positions(HAND, np.array(angles)), best, atol=1e-12)


@MOST
@given(st.lists(st.floats(0.0, 1.5), min_size=5, max_size=5))
def test_a_hand_that_moves_as_the_robot_gives_its_joints_back(joints: list[float]) -> None:
    np.testing.assert_allclose(
        synergies_from_joints(HAND) @ (joints_from_synergies(HAND) @ np.array(joints)), joints, atol=1e-12
    )


def test_it_takes_a_whole_run_at_once() -> None:
    run = np.random.default_rng(1).uniform(0.0, 1.0, (7, 3, 14))
    assert synergy_positions(HAND, run).shape == (7, 3, 5)
    np.testing.assert_allclose(synergy_positions(HAND, run)[2, 1], synergy_positions(HAND, run[2, 1]))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("right_thumb_ipj = 1.2", "right_tail = 1.2", "right_thumb.drives = 'right_tail'"),
        ("right_thumb_ipj = 1.2", "right_thumb_ipj = 0.0", "right_thumb.drives = .*at least one joint"),
        ("{ right_index_mpj = 1.0,", "{ right_thumb_mpj = 1.0,", "right_index.drives = 'right_thumb_mpj'"),
    ],
)  # fmt: skip
def test_a_synergy_that_cannot_be(old: str, new: str, message: str) -> None:
    text = (resources.files("common.skeleton") / "hand.toml").read_text("utf-8")
    assert old in text
    with pytest.raises(ConfigError, match=f"other.toml: {message}"):
        parse_skeleton(text.replace(old, new, 1), "other.toml")
