"""How far an estimate is from optical truth, by the measure of BROAD.

Laidig, Caruso, Cereatti and Seel, BROAD: A Benchmark for Robust Inertial Orientation Estimation (Data 6(7),
2021): the error is taken in the world frame and split into a turn about the vertical and the rest; each
trial's figure is the RMSE over its movement phase.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from common.quaternion import Array, conjugate, heading_rad, heading_turn, multiply
from common.wire.messages import Mask
from deploy.measure.estimated import LEAST_ESTIMATED


@dataclass(frozen=True, slots=True)
class OrientationErrors:
    """Errors of T samples, rad, not below 0; NaN where there is no truth or no estimate."""

    total: Array
    """(T,) angle of the rotation from truth to estimate."""
    heading: Array
    """(T,) angle of its part about the vertical."""
    inclination: Array
    """(T,) angle of the rest, about a horizontal axis."""
    known: Mask
    """(T,) where there is truth."""


@dataclass(frozen=True, slots=True)
class Score:
    """RMSE over the movement phase, °; None where too little of it was estimated to say."""

    total_deg: float | None
    heading_deg: float | None
    inclination_deg: float | None
    estimated: float
    """Share of the movement's samples with truth for which there was an estimate. Those without count for no
    error, which would make a filter that gives up look better."""


def errors(q_world_from_sensor: Array, truth: Array) -> OrientationErrors:
    """Errors of estimates (T, 4) against truth (T, 4)."""
    e = multiply(q_world_from_sensor, conjugate(truth))
    # the paper's 2 acos |w|, 2 atan |z / w| and 2 acos √(w² + z²), by atan2: well-conditioned near 0 too
    return OrientationErrors(
        total=2.0 * np.arctan2(np.linalg.norm(e[:, 1:], axis=1), np.abs(e[:, 0])),
        heading=2.0 * np.arctan2(np.abs(e[:, 3]), np.abs(e[:, 0])),
        inclination=2.0 * np.arctan2(np.hypot(e[:, 1], e[:, 2]), np.hypot(e[:, 0], e[:, 3])),
        known=np.asarray(np.isfinite(truth).all(axis=1)),
    )


def score(found: OrientationErrors, movement: Mask) -> Score:
    """RMSE over the samples of `movement` (T,) that have truth; withheld below LEAST_ESTIMATED of them."""
    asked = movement & found.known
    counts = asked & np.isfinite(found.total)
    share = int(counts.sum()) / max(1, int(asked.sum()))
    if share < LEAST_ESTIMATED:
        return Score(None, None, None, share)
    total, heading, inclination = (
        float(np.degrees(np.sqrt(np.mean(np.square(part[counts])))))
        for part in (found.total, found.heading, found.inclination)
    )
    return Score(total, heading, inclination, share)


def with_heading_of(truth: Array, q_world_from_sensor: Array, movement: Mask) -> Array:
    """Estimates (T, 4) turned about the vertical as one, to the truth's heading where movement begins.

    For six-axis estimates, whose heading starts anywhere; their drift stays in the figures.
    """
    known = movement & np.isfinite(truth).all(axis=1) & np.isfinite(q_world_from_sensor).all(axis=1)
    if not known.any():
        return q_world_from_sensor
    first = int(np.flatnonzero(known)[0])
    between = multiply(truth[first], conjugate(q_world_from_sensor[first]))
    return multiply(heading_turn(heading_rad(between)), q_world_from_sensor)
