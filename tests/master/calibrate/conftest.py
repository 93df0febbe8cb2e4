"""A calibration session as a perfect node would read it, and what imperfect sensors make of it."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest

from common.quaternion import Array, conjugate, from_rotation_vector, multiply, normalise, rotate

GRAVITY_M_S2 = 9.80665


@dataclass(frozen=True)
class Session:
    """True specific force and rate, (T, 3) both, and which samples rest, (T,)."""

    rate_hz: float
    acc: Array
    gyr: Array
    still: Array


MakeSession = Callable[..., Session]


def make(
    attitudes: int = 24, seed: int = 0, rate_hz: float = 100.0, rest_s: float = 3.0, axis: Array | None = None
) -> Session:
    """Rests in random attitudes with smooth turns of 1.5 s between them; about one body axis where given."""
    rng = np.random.default_rng(seed)
    q = normalise(rng.normal(size=4))
    rest, move = round(rest_s * rate_hz), round(1.5 * rate_hz)
    x = np.arange(move) / move
    progress, speed = 10 * x**3 - 15 * x**4 + 6 * x**5, 30 * x**2 * (1 - x) ** 2 / 1.5
    orientations, rates, still = [], [], []
    for _ in range(attitudes):
        orientations.append(np.tile(q, (rest, 1)))
        rates.append(np.zeros((rest, 3)))
        still.append(np.ones(rest, dtype=bool))
        direction = rng.normal(size=3) if axis is None else axis
        turn = direction / np.linalg.norm(direction) * rng.uniform(0.8, 2.5)
        orientations.append(multiply(q, from_rotation_vector(progress[:, None] * turn)))
        rates.append(speed[:, None] * turn)
        still.append(np.zeros(move, dtype=bool))
        q = multiply(q, from_rotation_vector(turn))
    q_world_from_sensor = np.concatenate(orientations)
    acc = rotate(conjugate(q_world_from_sensor), np.array([0.0, 0.0, GRAVITY_M_S2]))
    return Session(rate_hz, acc, np.concatenate(rates), np.concatenate(still))


@pytest.fixture(scope="session")
def session() -> MakeSession:
    return make
