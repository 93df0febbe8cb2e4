import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from common.quaternion import (
    Array,
    angle_between,
    conjugate,
    cross,
    from_axis_angle,
    from_rotation_vector,
    heading_rad,
    heading_turn,
    multiply,
    normalise,
    rotate,
    to_matrix,
    to_rotation_vector,
)


def random_rotations(count: int, seed: int = 0) -> tuple[Array, Rotation]:
    rotation = Rotation.random(count, rng=seed)
    return rotation.as_quat(scalar_first=True), rotation


def test_multiply_conjugate_rotate_and_matrix_agree_with_scipy() -> None:
    p, rp = random_rotations(200, 1)
    q, rq = random_rotations(200, 2)
    v = np.random.default_rng(3).normal(size=(200, 3))
    product = (rp * rq).as_quat(scalar_first=True)
    assert np.allclose(np.abs(np.sum(multiply(p, q) * product, axis=-1)), 1.0, atol=1e-14)
    assert np.allclose(rotate(q, v), rq.apply(v), atol=1e-14)
    assert np.allclose(rotate(conjugate(q), v), rq.inv().apply(v), atol=1e-14)
    assert np.allclose(to_matrix(q), rq.as_matrix(), atol=1e-14)
    assert np.allclose(cross(v, v[::-1]), np.cross(v, v[::-1]), atol=1e-14)


def test_hamilton_s_own_rules() -> None:
    one, i, j, k = np.eye(4)
    for a, b, c in ((i, j, k), (j, k, i), (k, i, j)):
        assert np.array_equal(multiply(a, b), c)
        assert np.array_equal(multiply(b, a), -c)
        assert np.array_equal(multiply(a, a), -one)


def test_leading_axes_broadcast() -> None:
    p, _ = random_rotations(6)
    q, _ = random_rotations(4, 1)
    product = multiply(p.reshape(3, 2, 1, 4), q)
    assert product.shape == (3, 2, 4, 4)
    assert np.allclose(product[2, 1, 3], multiply(p[5], q[3]))
    assert rotate(p.reshape(3, 2, 4), np.array([0.0, 0.0, 1.0])).shape == (3, 2, 3)
    assert to_matrix(p.reshape(3, 2, 4)).shape == (3, 2, 3, 3)
    assert to_matrix(p[0]).shape == (3, 3)


def test_a_nan_row_leaves_the_others_alone() -> None:
    p, _ = random_rotations(36)
    q, _ = random_rotations(36, 1)
    clean = multiply(p, q)
    p[7] = np.nan
    assert np.array_equal(np.delete(multiply(p, q), 7, 0), np.delete(clean, 7, 0))


vectors = st.lists(st.floats(-1.8, 1.8), min_size=3, max_size=3).map(np.array)


@given(vectors)
def test_rotation_vectors_there_and_back(v: Array) -> None:
    q = from_rotation_vector(v)
    assert np.linalg.norm(q) == pytest.approx(1.0, abs=1e-15)
    back = to_rotation_vector(q)
    if np.linalg.norm(v) < np.pi - 1e-6:
        assert np.allclose(back, v, atol=1e-12)
    assert np.allclose(to_rotation_vector(-q), back, atol=1e-12)


@pytest.mark.parametrize("size", [0.0, 1e-300, 1e-12, np.pi - 1e-9])
def test_rotation_vectors_at_the_ends_of_their_range(size: float) -> None:
    v = np.array([0.0, size, 0.0])
    assert np.allclose(to_rotation_vector(from_rotation_vector(v)), v, rtol=1e-12)


def test_axis_angle_and_angle_between() -> None:
    angles = np.linspace(0.0, np.pi, 7)
    q = from_axis_angle([0.0, 0.0, 1.0], angles)
    assert np.allclose(angle_between(q[0], q), angles)
    assert np.allclose(angle_between(q[0], -q), angles)


def test_normalise() -> None:
    assert np.allclose(normalise(np.array([[0.0, 3.0, 0.0, 4.0]])), [[0.0, 0.6, 0.0, 0.8]])


@given(st.floats(-3.1, 3.1), st.floats(-1.5, 1.5), st.floats(-3.1, 3.1))
def test_heading_is_the_nearest_turn_about_the_vertical(heading: float, tilt: float, way: float) -> None:
    leaning = from_rotation_vector(tilt * np.array([np.cos(way), np.sin(way), 0.0]))
    q = multiply(heading_turn(heading), leaning)
    assert float(heading_rad(q)) == pytest.approx(heading, abs=1e-9)
    assert float(heading_rad(-q)) == pytest.approx(heading, abs=1e-9)
    nearest = angle_between(heading_turn(heading_rad(q)), q)
    for other in np.linspace(-3.0, 3.0, 13):
        assert nearest <= angle_between(heading_turn(other), q) + 1e-7
