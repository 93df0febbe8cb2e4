"""What perfect sensors read, for every test of the orientations."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from common.quaternion import Array, conjugate, rotate
from common.wire.messages import Mask

RATE_HZ = 200.0
GRAVITY = np.array([0.0, 0.0, 9.81])
FIELD_UT = np.array([0.0, 28.0, -39.0])
NO_FIELD = np.full(3, np.nan)


@dataclass(frozen=True, slots=True)
class Node:
    """Of a node's configuration, what the estimator reads."""

    filter: str | None = None
    calibration: Path | None = None


@dataclass(frozen=True, slots=True)
class Readings:
    """Of all nodes at one tick."""

    acc_m_s2: Array
    gyr_rad_s: Array
    mag_ut: Array
    fresh: Mask
    lost: Mask


def attitudes(count: int, seed: int = 0) -> Array:
    """(N, 4) anywhere."""
    return Rotation.random(count, rng=seed).as_quat(scalar_first=True)


def seen(q: Array, v_world: Array) -> Array:
    """A world vector in each sensor's coordinates."""
    return np.ascontiguousarray(rotate(conjugate(q), np.broadcast_to(v_world, (*q.shape[:-1], 3))))


def seen_by(q_world_from_sensor: Array, rate_rad_s: Array, acc_world: Array = GRAVITY) -> Readings:
    """What perfect, fresh sensors read."""
    count = len(q_world_from_sensor)
    return Readings(
        acc_m_s2=seen(q_world_from_sensor, acc_world),
        gyr_rad_s=rate_rad_s,
        mag_ut=seen(q_world_from_sensor, FIELD_UT),
        fresh=np.ones(count, dtype=np.bool_),
        lost=np.zeros(count, dtype=np.bool_),
    )
