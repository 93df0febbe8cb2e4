"""The settings that a network needs over those of the example files. Pure."""

from __future__ import annotations

import math

from common.link.config import LinkConfig
from deploy.sim.network import Profile
from slave.guard.config import GuardConfig

STEP_S = 0.05
MARGIN_S = 0.05
"""For what a command waits before it is put, and for a busy machine."""
WANDERS = 4.0
"""Standard deviations of jitter that a command may be late by and still be taken."""


def needed_age_s(profile: Profile) -> float:
    """The guard's age limit: the default, which follows the line up to its ceiling, or what commands need.

    The guard adds the offset's bound, half the least round trip, to a command's age. Over a very long line
    this exceeds the ceiling, and a robot that accepts no command shows nothing about the line.
    """
    to_robot, to_operator = profile.ways.to_robot, profile.ways.to_operator
    bound_ms = 0.5 * (to_robot.delay_ms + to_operator.delay_ms)
    needed_s = 1e-3 * (to_robot.delay_ms + bound_ms + WANDERS * to_robot.jitter_ms) + MARGIN_S
    if needed_s <= GuardConfig().max_age_ceiling_s:
        return GuardConfig().max_age_s
    return round(STEP_S * math.ceil(needed_s / STEP_S - 1e-9), 3)


def open_timeout_s(profile: Profile) -> float:
    """`[link] open_timeout_s`: the default where that is six round trips, or what six round trips take."""
    needed_s = 6e-3 * (profile.ways.to_robot.delay_ms + profile.ways.to_operator.delay_ms)
    default_s = LinkConfig().open_timeout_s
    return default_s if needed_s <= default_s else math.ceil(2.0 * needed_s) / 2.0
