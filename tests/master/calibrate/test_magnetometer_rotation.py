from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from common.errors import TandemError
from common.quaternion import (
    Array,
    angle_between,
    conjugate,
    from_rotation_vector,
    normalise,
    rotate,
)
from master.calibrate.magnetometer_rotation import align_magnetometer

FIELD = np.array([0.0, 25.0, -43.3])


def attitudes(seed: int, count: int, apart: Array, noise: float = 0.0) -> tuple[Array, Array]:
    random = np.random.default_rng(seed)
    q_sensor_from_world = normalise(random.standard_normal((count, 4)))
    acc = rotate(q_sensor_from_world, np.array([0.0, 0.0, 9.81]))
    mag = rotate(conjugate(apart), rotate(q_sensor_from_world, FIELD))
    return acc, mag + noise * random.standard_normal(mag.shape)


@settings(max_examples=30, deadline=None, derandomize=True)
@given(st.integers(0, 1000), st.tuples(*[st.floats(-0.08, 0.08)] * 3))
def test_a_known_rotation_is_found_within_its_own_uncertainty(
    seed: int, vector: tuple[float, float, float]
) -> None:
    apart = from_rotation_vector(np.array(vector))
    found = align_magnetometer(*attitudes(seed, 26, apart, noise=0.05))
    assert float(angle_between(found.q_acc_from_mag, apart)) < 5.0 * found.sigma_rad
    assert found.sigma_rad < np.radians(0.2)


def test_without_noise_it_is_exact_and_the_map_turns_with_it() -> None:
    apart = from_rotation_vector(np.array([0.01, -0.02, 0.005]))
    acc, mag = attitudes(1, 20, apart)
    found = align_magnetometer(acc, mag)
    assert float(angle_between(found.q_acc_from_mag, apart)) < 1e-9
    assert found.after_rad < 1e-9 < found.before_rad
    affine = np.column_stack([np.eye(3), [1.0, 2.0, 3.0]])
    reading = np.array([4.0, 5.0, 6.0, 1.0])
    np.testing.assert_allclose(found.apply(affine) @ reading, rotate(apart, affine @ reading), atol=1e-9)


def test_attitudes_that_do_not_tell_are_refused() -> None:
    same = from_rotation_vector(np.zeros(3))
    with pytest.raises(TandemError, match="attitudes"):
        align_magnetometer(*attitudes(1, 5, same))
    flat = np.linspace(0.0, 6.0, 20)[:, None] * np.array([0.0, 0.0, 1.0])
    turned = from_rotation_vector(flat)
    with pytest.raises(TandemError, match="how the magnetometer is turned"):
        align_magnetometer(rotate(turned, np.array([0.0, 0.0, 9.81])), rotate(turned, FIELD))


def test_a_sensor_turned_by_more_than_an_imperfection_is_refused() -> None:
    with pytest.raises(TandemError, match="10°"):
        align_magnetometer(*attitudes(1, 20, from_rotation_vector(np.array([0.5, 0.0, 0.0]))))
