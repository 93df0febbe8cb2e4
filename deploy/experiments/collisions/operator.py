"""A random operator: reaches anywhere, often into the robot itself, and now and then goes home."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from common.quaternion import Array
from slave.guard.limits import MotionLimits

HOME_EVERY = 10
WAITS_S = 4.0
INTO_ITSELF = {
    "arms crossed": {"shoulder_pitch": 45, "shoulder_roll": -10, "shoulder_yaw": -75, "elbow_pitch": 90},
    "hands on the head": {"shoulder_pitch": 135, "shoulder_yaw": -50, "elbow_pitch": 122},
    "hands through the chest": {
        "shoulder_pitch": -25, "shoulder_roll": 10, "shoulder_yaw": -70, "elbow_pitch": 129,
    },
}  # fmt: skip
"""Degrees of both arms alike, for a robot that has such joints."""
_SPREAD_RAD = 0.25


@dataclass(frozen=True, slots=True)
class OperatorMove:
    """One motion, tick by tick."""

    kind: str
    position_rad: Array
    """(T, J)"""
    velocity_rad_s: Array
    home: bool = False
    """Whether it ends at home, where the robot must be able to follow it."""


def moves(
    seed: int, joint_names: tuple[str, ...], limits: MotionLimits, home_rad: Array, dt_s: float
) -> Iterator[OperatorMove]:
    """Endless minimum-jerk motions from posture to posture, 0.2 to 1.5 s each; every tenth goes home."""
    rng, at = np.random.default_rng(seed), home_rad
    known = {kind: _posture(degrees, joint_names, limits) for kind, degrees in INTO_ITSELF.items()}
    kinds = ["anywhere", *(kind for kind, posture in known.items() if posture.any())]
    for count in range(1, 2**62):
        duration_s = float(rng.uniform(0.2, 1.5))
        kind = kinds[int(rng.integers(len(kinds)))]
        home = count % HOME_EVERY == 0
        if home:
            to = home_rad
        elif kind == "anywhere":
            to = rng.uniform(limits.lower_rad, limits.upper_rad)
        else:
            to = limits.reachable(known[kind] + rng.normal(0.0, _SPREAD_RAD, len(at)))
        u = np.minimum(np.arange(1, round(duration_s / dt_s) + 1) * dt_s / duration_s, 1.0)[:, None]
        share, rate = u**3 * (10.0 - 15.0 * u + 6.0 * u**2), 30.0 * u**2 * (1.0 - u) ** 2 / duration_s
        yield OperatorMove("home" if home else kind, at + share * (to - at), rate * (to - at), home)
        at = to


def _posture(degrees: dict[str, int], joint_names: tuple[str, ...], limits: MotionLimits) -> Array:
    angles = [degrees.get(name.partition("_")[2], 0) for name in joint_names]
    return limits.reachable(np.radians(np.array(angles, np.float64)))
