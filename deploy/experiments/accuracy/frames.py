"""Whether optical truth speaks of another frame than the estimate, or in another order.

Markers on a unit and cameras in a room are each turned by a constant rotation against the unit's sensors and
against east-north-up: estimate = world · truth · sensor. Both can be found from the data alone where the unit
turned about more than one axis (the hand-eye problem; here by alternating quaternion means, which do not mind
that q and -q are one rotation).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from common.quaternion import IDENTITY, Array, angle_between, conjugate, multiply, normalise
from common.wire.messages import Mask

_FEW = 800
"""Samples to fit to, spread evenly."""
_ROUNDS = 40
_EXPLAINS = 0.4
"""The share of the RMS error that may be left if a change explains most of it."""
_WORTH_RAD = math.radians(5.0)
"""Smaller errors need no explanation."""


@dataclass(frozen=True, slots=True)
class FrameRotations:
    """estimate = world · truth · sensor, quaternions (4,) wxyz."""

    world: Array
    sensor: Array

    def applied(self, truth: Array) -> Array:
        """The truth (T, 4) in the estimate's frames."""
        return multiply(multiply(self.world, truth), self.sensor)

    def tree(self) -> dict[str, list[float]]:
        """As JSON."""
        return {"world": self.world.tolist(), "sensor": self.sensor.tolist()}

    def words(self) -> str:
        """Both rotations for a person."""
        return f"world side {_turn(self.world)}, sensor side {_turn(self.sensor)}"


def fit(q_world_from_sensor: Array, truth: Array, counts: Mask) -> FrameRotations:
    """The two constant rotations that bring truth (T, 4) nearest to the estimates (T, 4) where `counts` (T,).

    Samples without estimate or truth are left out; identities where none is left.
    """
    rows = _some(q_world_from_sensor, truth, counts)
    if not len(rows):
        return FrameRotations(IDENTITY, IDENTITY)
    q, t = q_world_from_sensor[rows], normalise(truth[rows])
    best, left = FrameRotations(IDENTITY, IDENTITY), math.inf
    for sensor in _starts():
        for _ in range(_ROUNDS):
            world = _mean(multiply(q, conjugate(multiply(t, sensor))))
            sensor = _mean(multiply(conjugate(multiply(world, t)), q))
        found = FrameRotations(world, sensor)
        off = _rms(q, found.applied(t))
        if off < left - 1e-9:
            best, left = found, off
    return best


def hint(q_world_from_sensor: Array, truth: Array, counts: Mask) -> str | None:
    """What would explain most of the error, in words; None where nothing does, or little is to explain."""
    rows = _some(q_world_from_sensor, truth, counts)
    if not len(rows):
        return None
    q, t, all_ = q_world_from_sensor[rows], truth[rows], np.ones(len(rows), dtype=np.bool_)
    now = _rms(q, t)
    if now < _WORTH_RAD:
        return None
    # plain readings first: two rotations beside a conjugate would imitate another order of the elements
    for aligned, (reading, read) in product((False, True), READINGS):
        if not aligned and read is _as_it_is:
            continue
        other = read(t)
        left = _rms(q, fit(q, other, all_).applied(other) if aligned else other)
        if left < _EXPLAINS * now:
            what = " and ".join([*([reading] if reading else []), *(["with --align"] if aligned else [])])
            return f"{_deg(now)}° in all would be {_deg(left)}° {what}"
    return None


def _some(q_world_from_sensor: Array, truth: Array, counts: Mask) -> NDArray[np.intp]:
    """At most _FEW rows, evenly spread, that count and have both estimate and truth."""
    known = counts & np.isfinite(q_world_from_sensor).all(axis=1) & np.isfinite(truth).all(axis=1)
    rows = np.flatnonzero(known)
    return rows[np.unique(np.linspace(0, len(rows) - 1, min(_FEW, len(rows))).astype(np.intp))]


def _as_it_is(truth: Array) -> Array:
    return truth


def _wxyz(truth: Array) -> Array:
    return np.roll(truth, 1, axis=1)


READINGS: tuple[tuple[str, Callable[[Array], Array]], ...] = (
    ("", _as_it_is),
    ("if quat were conjugated: it seems to lead from the world to the sensor", conjugate),
    ("if quat were xyzw: write it wxyz", _wxyz),
    ("if quat were xyzw and conjugated", lambda truth: conjugate(_wxyz(truth))),
)
"""Ways to read the truth, the likeliest first."""


def _starts() -> list[Array]:
    """Sensor sides to begin from: the rotations of a cube, as the alternation finds the nearest optimum."""
    out = [np.eye(4)[axis] for axis in range(4)]
    out += [normalise(np.array([1.0, *signs])) for signs in product((1.0, -1.0), repeat=3)]
    return out


def _mean(q: Array) -> Array:
    """The mean rotation (4,) of quaternions (T, 4), of whatever sign (Markley et al. 2007)."""
    _, vectors = np.linalg.eigh(q.T @ q)
    out: Array = vectors[:, -1]
    return out


def _rms(q: Array, truth: Array) -> float:
    return float(np.sqrt(np.mean(np.square(angle_between(q, normalise(truth))))))


def _turn(q: Array) -> str:
    q = q if q[0] >= 0.0 else -q
    angle = 2.0 * math.atan2(float(np.linalg.norm(q[1:])), float(q[0]))
    axis = q[1:] / max(float(np.linalg.norm(q[1:])), 1e-12)
    return f"{_deg(angle)}° about ({axis[0]:.2f}, {axis[1]:.2f}, {axis[2]:.2f})"


def _deg(angle_rad: float) -> str:
    return f"{math.degrees(angle_rad):.2f}"
