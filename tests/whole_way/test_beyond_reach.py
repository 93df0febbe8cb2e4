"""The whole way with an operator who goes where the robot cannot: it goes as far as it can, stays, comes back."""

from __future__ import annotations

import math

import numpy as np
import pytest

from common.clock import NS_PER_S
from common.quaternion import Array
from common.skeleton import load_skeleton
from deploy.following import engaged
from deploy.virtual import VirtualRun, World
from master.suit.simulated.minimum_jerk import MinimumJerkMotion, Move

SKELETON = load_skeleton("nursing")
NAMES = SKELETON.joint_names
BEGIN_S, RAISE_S, HOLD_S = 10.0, 2.0, 2.5
END_S = BEGIN_S + 2.0 * RAISE_S + HOLD_S


def raised(joint: str, to_deg: float) -> VirtualRun:
    """A robot that has followed the raising of one joint, from BEGIN_S on, and the lowering of it again."""
    moves = [
        Move(joint, BEGIN_S, RAISE_S, math.radians(to_deg)),
        Move(joint, BEGIN_S + RAISE_S + HOLD_S, RAISE_S, 0.0),
    ]
    motion = MinimumJerkMotion(NAMES, np.zeros(len(NAMES)), moves, 60.0)
    run = engaged(World(motion=motion))
    run.run(BEGIN_S + END_S - (run.now_ns / NS_PER_S))
    return run


def course(run: VirtualRun, begin_s: float, end_s: float) -> dict[str, Array]:
    """Degrees of each joint by its encoder, between two times of the motion."""
    # the suit's motion begins with the run
    begin_ns = run.states[0].encoder_ns
    rows = [s for s in run.states if begin_s <= (s.encoder_ns - begin_ns) / NS_PER_S <= end_s]
    assert len(rows) > 10
    return dict(zip(NAMES, np.degrees([s.position_rad for s in rows]).T, strict=True))


@pytest.mark.parametrize(
    ("joint", "to_deg", "end_deg"),
    [
        ("left_shoulder_roll", 120.0, 80.0),
        ("right_shoulder_roll", 170.0, 80.0),
        ("left_shoulder_pitch", 185.0, 150.0),
        ("waist_pitch", 110.0, 60.0),
    ],
)
def test_the_robot_stays_at_its_end_of_range_and_comes_back(
    joint: str, to_deg: float, end_deg: float
) -> None:
    run = raised(joint, to_deg)
    assert run.slave.guard.state == "track", run.slave.guard.reason
    assert not run.slave.guard.counters.losses
    for name, degrees in course(run, BEGIN_S, END_S + 1.0).items():
        if name == joint:
            # predicting overshoots the end by a little, and the limits cut that off
            assert degrees.min() > -3.0
            assert degrees.max() < end_deg + 0.5
        else:
            assert np.abs(degrees).max() < 6.0, name
    top = course(run, BEGIN_S + RAISE_S + 0.5, BEGIN_S + RAISE_S + HOLD_S - 0.1)[joint]
    np.testing.assert_allclose(top, end_deg, atol=1.5)
    for name, degrees in course(run, END_S + 1.0, END_S + 2.0).items():
        np.testing.assert_allclose(degrees, 0.0, atol=2.0, err_msg=name)
    steps = np.degrees(np.abs(np.diff([c.position_rad for c in run.commands if c.valid.all()], axis=0)))
    assert steps.max() < 20.0
