"""A robot none of whose parts can meet, such as the hand, goes where it would without a damper."""

from __future__ import annotations

import numpy as np

from common.skeleton import load_skeleton
from slave.guard import GuardConfig
from slave.limit.damper import DistanceDamper
from slave.limit.limit import SetpointLimiter


def test_without_pairs_nothing_is_held_off() -> None:
    skeleton = load_skeleton("hand")
    limits = GuardConfig().limits(skeleton)
    none = np.zeros(len(skeleton.joints), np.bool_)
    damper = DistanceDamper(skeleton, 2.0, ())
    damped, free = (SetpointLimiter(skeleton.joint_names, limits, each) for each in (damper, None))
    target = 0.5 * (limits.lower_rad + limits.upper_rad)
    for limiter in (damped, free):
        limiter.seat(np.clip(0.0, limits.lower_rad, limits.upper_rad))
        for tick in range(100):
            most = limits.max_velocity_rad_s, limits.max_acceleration_rad_s2
            limiter.step(5_000_000 * tick, 0.005, target, np.zeros(len(none)), none, *most)
    np.testing.assert_array_equal(damped.position_rad, free.position_rad)
    assert np.abs(damped.position_rad).max() > 0.1
    assert not damper.held_back.any()
