"""A site's tighter limit is kept before the tracker sees a command, and counted once."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from common.quaternion import Array
from common.skeleton import load_skeleton
from slave.guard.config import GuardConfig, JointLimits
from slave.guard.events import Rule

NAMES = load_skeleton("nursing").joint_names
ROLL = NAMES.index("left_shoulder_roll")


def arm(roll_deg: float) -> Array:
    """Every joint at zero but the left shoulder's roll."""
    angles: Array = np.zeros(len(NAMES))
    angles[ROLL] = np.radians(roll_deg)
    return angles


def test_the_guard_tells_of_it_once_as_of_any_clamp(make_rig: Callable[..., Any]) -> None:
    config = GuardConfig(jump_window_rad=4.0, joints={"left_shoulder_roll": JointLimits(upper_deg=30.0)})
    rig = make_rig(config).to_track()
    rig.send(position_rad=arm(0.0))
    before = rig.guard.counters.clamps[Rule.POSITION]
    target = arm(60.0)
    for _ in range(4):
        rig.send(position_rad=target)
    assert rig.guard.counters.clamps[Rule.POSITION] == before + 1
    assert np.degrees(rig.tracker.newest.position_rad[ROLL]) <= 30.0 + 1e-9
