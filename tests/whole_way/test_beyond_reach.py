"""The whole way with an operator who goes beyond the robot's reach: it goes to its end, stays, comes back."""

from __future__ import annotations

import math

import numpy as np
import pytest

from common.clock import NS_PER_S
from common.quaternion import Array
from common.skeleton import load_skeleton
from deploy.sim.suit.minimum_jerk import MinimumJerkMotion, Move
from deploy.sim.world.world import VirtualWorld, WorldSettings
from tests.whole_way.runs import engaged

SKELETON = load_skeleton("nursing")
NAMES = SKELETON.joint_names
BEGIN_S, RAISE_S, HOLD_S = 10.0, 2.0, 2.5
END_S = BEGIN_S + 2.0 * RAISE_S + HOLD_S
TO_DEG = {"left_shoulder_roll": 120.0, "right_shoulder_pitch": 185.0, "waist_pitch": 110.0}
"""Left arm sideways, right arm ahead and overhead, trunk bowed: all further than the robot can."""


@pytest.fixture(scope="module")
def raised() -> VirtualWorld:
    """A robot that has followed there and back."""
    moves = [
        Move(joint, start_s, RAISE_S, math.radians(to_deg))
        for joint, farthest_deg in TO_DEG.items()
        for start_s, to_deg in ((BEGIN_S, farthest_deg), (BEGIN_S + RAISE_S + HOLD_S, 0.0))
    ]
    run = engaged(WorldSettings(motion=MinimumJerkMotion(NAMES, np.zeros(len(NAMES)), moves, 60.0)))
    run.run(BEGIN_S + END_S - run.now_ns / NS_PER_S)
    return run


def course(run: VirtualWorld, begin_s: float, end_s: float) -> dict[str, Array]:
    """Degrees of each joint by its encoder, between two times of the motion."""
    # the suit's motion begins with the run
    begin_ns = run.states[0].encoder_ns
    rows = [s for s in run.states if begin_s <= (s.encoder_ns - begin_ns) / NS_PER_S <= end_s]
    assert len(rows) > 10
    return dict(zip(NAMES, np.degrees([s.position_rad for s in rows]).T, strict=True))


def test_the_robot_goes_on_following(raised: VirtualWorld) -> None:
    assert raised.slave.guard.state == "track", raised.slave.guard.reason
    assert not raised.slave.guard.counters.losses
    assert not raised.slave.guard.counters.doubts


def test_each_joint_stays_at_its_end_of_range(raised: VirtualWorld) -> None:
    ends = dict(zip(NAMES, np.degrees(SKELETON.upper_rad), strict=True))
    for name, degrees in course(raised, BEGIN_S + RAISE_S + 0.5, BEGIN_S + RAISE_S + HOLD_S - 0.1).items():
        np.testing.assert_allclose(degrees, ends[name] if name in TO_DEG else 0.0, atol=4.0, err_msg=name)


def test_no_other_joint_is_told_to_move_and_none_goes_past_its_end(raised: VirtualWorld) -> None:
    told = np.degrees([c.position_rad for c in raised.commands if c.valid.all()])
    others = [j for j, name in enumerate(NAMES) if name not in TO_DEG]
    assert np.abs(told[:, others]).max() < 4.0
    past = np.degrees(SKELETON.upper_rad) + 0.5
    for j, degrees in enumerate(course(raised, BEGIN_S, END_S + 1.0).values()):
        # what hangs on an arm that stops is shaken; at its end of range nothing is
        assert degrees.max() < (15.0 if j in others else past[j]), NAMES[j]


def test_afterwards_the_robot_is_where_it_was(raised: VirtualWorld) -> None:
    for name, degrees in course(raised, END_S + 1.0, END_S + 2.0).items():
        np.testing.assert_allclose(degrees, 0.0, atol=2.0, err_msg=name)


def test_no_command_jumps(raised: VirtualWorld) -> None:
    told = np.degrees([c.position_rad for c in raised.commands if c.valid.all()])
    # the fastest of the three moves turns by 14° in a command's period
    assert np.abs(np.diff(told, axis=0)).max() < 1.5 * 14.0 + 2.0


def test_the_operator_is_told(raised: VirtualWorld) -> None:
    figures = raised.beyond_reach()
    assert {name for name, one in figures.items() if one.most_deg > 15.0} == {
        "chest", "left_upper_arm", "right_upper_arm"
    }  # fmt: skip
    assert figures["left_upper_arm"].most_deg == pytest.approx(40.0, abs=2.0)
    assert figures["chest"].now_deg == pytest.approx(0.0, abs=1.0)
