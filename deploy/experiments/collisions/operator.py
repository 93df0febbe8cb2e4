"""A random operator: asks for a new posture with every command, often into the robot itself."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from common.quaternion import Array
from slave.guard.limits import MotionLimits

COMMANDS_PER_S = 12.5
MOST_IN_A_ROW = 25
"""Motions around one place: up to 2 s, in which the robot gets there."""
HOME_EVERY = 10
"""Places until he goes home."""
LINE_DIES = 0.1
"""Share of places after which no more commands come until the robot stands."""
INTO_ITSELF = {
    "arms crossed": {"shoulder_pitch": 45, "shoulder_roll": -10, "shoulder_yaw": -75, "elbow_pitch": 90},
    "hands on the head": {"shoulder_pitch": 135, "shoulder_yaw": -50, "elbow_pitch": 122},
    "hands through the chest": {
        "shoulder_pitch": -25, "shoulder_roll": 10, "shoulder_yaw": -70, "elbow_pitch": 129,
    },
}  # fmt: skip
"""Degrees of both arms alike, for a robot that has such joints."""
HOME = "home"
_SPREAD_RAD = 0.25
_SPEED_RAD_S = 1.0


@dataclass(frozen=True, slots=True)
class RandomGoal:
    """One fresh random goal: a posture and joint rates, (J,) each, that hold for one command's period."""

    kind: str
    position_rad: Array
    velocity_rad_s: Array
    line_dies: bool = False
    """Whether the robot then hears nothing, and brakes."""


def motions(
    rng: np.random.Generator, joint_names: tuple[str, ...], limits: MotionLimits, home_rad: Array
) -> Iterator[RandomGoal]:
    """Endless motions: some around one place, then around another; each tenth place is home, and exact.

    Half of the goals stand still, the others move on at random rates: harsher than any person, whose goals
    follow one another.
    """
    known = {kind: _posture(degrees, joint_names, limits) for kind, degrees in INTO_ITSELF.items()}
    kinds = ["anywhere", *(kind for kind, posture in known.items() if posture.any())]
    still = np.zeros_like(home_rad)
    for place in range(1, 2**62):
        if place % HOME_EVERY == 0:
            yield RandomGoal(HOME, home_rad, still)
            continue
        kind = kinds[int(rng.integers(len(kinds)))]
        center = known.get(kind, rng.uniform(limits.lower_rad, limits.upper_rad))
        in_a_row = int(rng.integers(1, MOST_IN_A_ROW + 1))
        dies = rng.random() < LINE_DIES
        for nth in range(1, in_a_row + 1):
            goal = limits.reachable(center + rng.normal(0.0, _SPREAD_RAD, len(center)))
            rate = rng.normal(0.0, _SPEED_RAD_S, len(center)) if rng.random() < 0.5 else still
            yield RandomGoal(kind, goal, rate, dies and nth == in_a_row)


def _posture(degrees: dict[str, int], joint_names: tuple[str, ...], limits: MotionLimits) -> Array:
    angles = [degrees.get(name.partition("_")[2], 0) for name in joint_names]
    return limits.reachable(np.radians(np.array(angles, np.float64)))
