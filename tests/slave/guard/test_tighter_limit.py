"""A site's tighter limit is kept before the tracker sees a command, and counted once."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from common.quaternion import Array
from common.skeleton import load_skeleton
from common.wire.messages import Action
from slave.guard.config import GuardConfig, JointLimits
from slave.guard.events import Rule
from slave.limit.nearest import NearestPosture

NAMES = load_skeleton("nursing").joint_names
ROLL = NAMES.index("left_shoulder_roll")


SHOULDER = [NAMES.index(f"left_shoulder_{axis}") for axis in ("pitch", "roll", "yaw")]
CONFIG = GuardConfig(jump_window_rad=4.0, joints={"left_shoulder_roll": JointLimits(upper_deg=30.0)})


def arm(roll_deg: float, pitch_deg: float = 0.0, yaw_deg: float = 0.0) -> Array:
    """Every joint at zero but the left shoulder's."""
    angles: Array = np.zeros(len(NAMES))
    angles[SHOULDER] = np.radians([pitch_deg, roll_deg, yaw_deg])
    return angles


def test_the_guard_tells_of_it_once_as_of_any_clamp(make_rig: Callable[..., Any]) -> None:
    rig = make_rig(CONFIG).to_track()
    rig.send(position_rad=arm(0.0))
    before = rig.guard.counters.clamps[Rule.POSITION]
    target = arm(60.0)
    for _ in range(4):
        rig.send(position_rad=target)
    assert rig.guard.counters.clamps[Rule.POSITION] == before + 1
    assert np.degrees(rig.tracker.newest.position_rad[ROLL]) <= 30.0 + 1e-9


def test_after_an_engage_the_nearest_posture_is_found_anew(make_rig: Callable[..., Any]) -> None:
    """What the operator did before the engage does not decide on which side of a jump the robot goes."""
    rig = make_rig(CONFIG).to_track()
    before, after = arm(79.0, -7.0, 75.0), arm(91.0, -9.0, 76.0)
    rig.run(0.4, position_rad=before)
    assert rig.ask(Action.DISENGAGE).done
    rig.run(2.0, position_rad=before)
    rig.engage()
    rig.now_ns += 80_000_000
    rig.send(position_rad=after)
    fresh = NearestPosture(rig.skeleton, CONFIG.limits(rig.skeleton))
    alone, _ = fresh.of(rig.now_ns, after, np.zeros(len(NAMES)), np.ones(len(NAMES), np.bool_))
    np.testing.assert_allclose(rig.tracker.newest.position_rad, alone, atol=1e-9)
