import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from common.quaternion import Array
from master.calibrate.gauss_newton import along_sphere, gauss_newton, half_sphere, tangents

FEW = settings(max_examples=30, deadline=None, derandomize=True)
directions = st.integers(0, 10_000).map(lambda seed: _unit(np.random.default_rng(seed).normal(size=3)))


def _unit(v: Array) -> Array:
    out: Array = v / np.linalg.norm(v)
    return out


@FEW
@given(directions, st.floats(-2.0, 2.0), st.floats(-2.0, 2.0))
def test_a_step_on_the_sphere_is_as_long_as_asked_and_stays_on_it(axis: Array, x: float, y: float) -> None:
    there = along_sphere(axis, np.array([x, y]))
    assert abs(np.linalg.norm(there) - 1.0) < 1e-12
    assert abs(np.arccos(np.clip(axis @ there, -1.0, 1.0)) - np.hypot(x, y)) < 1e-6


@FEW
@given(directions)
def test_tangents_are_orthonormal_and_touch_the_sphere(axis: Array) -> None:
    frame = np.column_stack([axis, tangents(axis)])
    np.testing.assert_allclose(frame.T @ frame, np.eye(3), atol=1e-12)


def test_starts_leave_no_axis_far_from_all_of_them() -> None:
    starts = half_sphere(6)
    np.testing.assert_allclose(np.linalg.norm(starts, axis=1), 1.0)
    axes = np.random.default_rng(0).normal(size=(500, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    assert np.degrees(np.arccos(np.max(np.abs(axes @ starts.T), axis=1))).max() < 50.0


def test_it_finds_the_minimum_and_never_goes_uphill() -> None:
    costs = []

    def rosenbrock(p: Array) -> tuple[Array, Array]:
        residual = np.array([10.0 * (p[1] - p[0] ** 2), 1.0 - p[0]])
        costs.append(float(residual @ residual))
        return residual, np.array([[-20.0 * p[0], 10.0], [-1.0, 0.0]])

    found = gauss_newton(rosenbrock, lambda p, x: p + x, np.array([-1.2, 1.0]), most_steps=100)
    np.testing.assert_allclose(found.state, 1.0, atol=1e-6)
    assert found.cost <= 0.5 * min(costs)


def test_where_the_data_say_nothing_it_stays() -> None:
    found = gauss_newton(lambda p: (np.ones(3), np.zeros((3, 2))), lambda p, x: p + x, np.zeros(2))
    np.testing.assert_array_equal(found.state, 0.0)
