"""A joint that keeps turning as it cannot is told; one that does so for a moment, or a little, is not."""

import math

import numpy as np
import pytest

from common.quaternion import IDENTITY, from_axis_angle
from common.skeleton import load_skeleton
from master.orientation.joints.contradicted import ContradictedJoints
from master.orientation.joints.online import OnlineConfig, OnlineHeadings
from master.suit.doubt import Weight

ALL = np.array([True])


def after(deg: float, seconds: float, usable: bool = True) -> ContradictedJoints:
    joints = ContradictedJoints(1)
    for _ in range(round(seconds / 0.08)):
        joints.add(np.array([math.sin(math.radians(deg))]), ALL & usable, 0.08)
    return joints


@pytest.mark.parametrize(
    ("deg", "seconds", "told"),
    [(24.0, 200.0, False), (26.0, 200.0, True), (60.0, 5.0, False), (60.0, 8.0, True)],
)
def test_it_takes_25_degrees_for_some_time(deg: float, seconds: float, told: bool) -> None:
    assert bool(after(deg, seconds).now[0]) == told


def test_a_node_that_is_not_usable_says_nothing() -> None:
    assert not after(60.0, 100.0, usable=False).now[0]


def test_it_ends_below_15_degrees_only() -> None:
    joints = after(40.0, 100.0)
    for deg, told in ((20.0, True), (14.0, False)):
        for _ in range(2000):
            joints.add(np.array([math.sin(math.radians(deg))]), ALL, 0.08)
        assert bool(joints.now[0]) == told


@pytest.mark.parametrize("deg", [0.0, 40.0])
def test_an_elbow_that_is_bent_sideways_for_good_is_named(deg: float) -> None:
    """Arms hang, the forearm leans sideways: an inclination, which no heading can put right."""
    arms = load_skeleton("nursing")
    count, forearm = len(arms.segments), arms.segment_names.index("left_forearm")
    online = OnlineHeadings(OnlineConfig(), arms, 200.0)
    q = np.tile(IDENTITY, (count, 1))
    q[forearm] = from_axis_angle(np.array([1.0, 0.0, 0.0]), math.radians(deg))
    for _ in range(400):
        online.correct(
            q, np.full((count, 3), np.nan), np.tile(IDENTITY, (count, 1)), np.ones(count, dtype=bool)
        )
    doubts = online.doubts()
    assert (forearm in doubts) == (deg > 0.0)
    if deg:
        assert "against left_upper_arm about an axis about which the joint cannot" in doubts[forearm].words
        assert doubts[forearm].weight is Weight.NOTED
