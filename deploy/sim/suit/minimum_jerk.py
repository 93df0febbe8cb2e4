"""Point-to-point movements of the smoothness that human reaches have."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from common.errors import TandemError
from common.quaternion import Array


@dataclass(frozen=True, slots=True)
class Move:
    """One joint goes from where it is to `to_rad` and rests there."""

    joint: str
    start_s: float
    duration_s: float
    to_rad: float


class MotionError(TandemError):
    """Moves that cannot be made: overlapping, of no known joint, past the period, or not returning."""


class MinimumJerkMotion:
    """A periodic motion of J named joints made of minimum-jerk moves, each from rest to rest.

    A move by Δ in time T follows Flash and Hogan 1985: θ = θ0 + Δ (10 u³ − 15 u⁴ + 6 u⁵), u = t / T. Speed
    peaks at 1.875 Δ / T, acceleration at 5.774 Δ / T². Velocity and acceleration are zero at both ends, so
    position, velocity and acceleration are continuous everywhere, the seam of the loop included.
    """

    def __init__(
        self, joint_names: Sequence[str], rest_rad: Array, moves: Sequence[Move], period_s: float
    ) -> None:
        self.period_s = period_s
        for move in moves:
            if move.joint not in joint_names:
                raise MotionError(f"a move of {move.joint}, which is none of the skeleton's joints")
        by_joint = [
            _timeline(joint, float(rest), [m for m in moves if m.joint == joint], period_s)
            for joint, rest in zip(joint_names, rest_rad, strict=True)
        ]
        most = max(len(timeline) for timeline in by_joint)
        table = np.empty((len(rest_rad), most, 4))
        for j, timeline in enumerate(by_joint):
            # a joint with fewer moves is filled up with moves that never start
            table[j] = timeline + [(np.inf, 1.0, rest_rad[j], 0.0)] * (most - len(timeline))
        self._starts = table[:, 1:, 0]
        self._table = table

    def state(self, t_s: ArrayLike) -> tuple[Array, Array, Array]:
        """Position rad, velocity rad/s and acceleration rad/s², (..., J), at times (...)."""
        t = np.mod(np.asarray(t_s, dtype=np.float64), self.period_s)[..., None]
        current = np.sum(self._starts <= t[..., None], axis=-1)
        move = self._table[np.arange(len(self._table)), current]
        start, duration, origin, change = (move[..., k] for k in range(4))
        u = np.clip((t - start) / duration, 0.0, 1.0)
        rest = 1.0 - u
        velocity = 30.0 * (u * rest) ** 2
        acceleration = 60.0 * u * rest * (rest - u)
        return (
            origin + change * (u**3 * (10.0 + u * (6.0 * u - 15.0))),
            change / duration * velocity,
            change / duration**2 * acceleration,
        )


def _timeline(
    joint: str, rest_rad: float, moves: Sequence[Move], period_s: float
) -> list[tuple[float, float, float, float]]:
    """Rows of start, duration, origin and change of one joint's moves; the first row is its rest."""
    rows = [(0.0, 1.0, rest_rad, 0.0)]
    at_rad, free_s = rest_rad, 0.0
    for move in sorted(moves, key=lambda m: m.start_s):
        which = f"{joint}: the move at {move.start_s:g} s"
        if move.duration_s <= 0.0:
            raise MotionError(f"{which} lasts {move.duration_s:g} s, expected more than 0")
        if move.start_s < free_s:
            raise MotionError(f"{which} begins before the one ahead ends, at {free_s:g} s")
        rows.append((move.start_s, move.duration_s, at_rad, move.to_rad - at_rad))
        at_rad, free_s = move.to_rad, move.start_s + move.duration_s
    if free_s > period_s:
        raise MotionError(f"{joint}: its last move ends at {free_s:g} s, past the period of {period_s:g} s")
    if at_rad != rest_rad:
        raise MotionError(f"{joint}: its last move does not return to rest, so the loop would jump")
    return rows
