import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from common.quaternion import (
    Array,
    angle_between,
    conjugate,
    from_rotation_vector,
    heading_rad,
    multiply,
    rotate,
    to_matrix,
    to_rotation_vector,
)
from master.orientation.ekf import EkfConfig, EkfFilter
from master.orientation.ekf_equations import (
    heading_update,
    predict,
    propagate,
    scalar_update,
    transition,
    turn_by,
)

from .perfect import FIELD_UT, GRAVITY, RATE_HZ, attitudes, seen

few = settings(max_examples=25, derandomize=True, deadline=None)
seeds = st.integers(0, 10_000)


def covariances(count: int, seed: int) -> Array:
    root = np.random.default_rng(seed).normal(size=(count, 6, 6))
    out: Array = root @ root.transpose(0, 2, 1)
    return out


@few
@given(seed=seeds)
def test_propagation_is_scipy_s(seed: int) -> None:
    rate = 20.0 * np.random.default_rng(seed).normal(size=(8, 3))
    q = attitudes(8, seed)
    expected = Rotation.from_quat(q, scalar_first=True) * Rotation.from_rotvec(0.01 * rate)
    found = Rotation.from_quat(propagate(q, rate, 0.01), scalar_first=True)
    assert np.max((found.inv() * expected).magnitude()) < 1e-12


@few
@given(seed=seeds)
def test_the_transition_is_the_derivative_of_the_propagation(seed: int) -> None:
    """Finite differences of what the filter does, in its own error states, at a high rate."""
    rng = np.random.default_rng(seed)
    q, gyr, bias, dt_s = attitudes(4, seed), rng.normal(size=(4, 3)), 0.1 * rng.normal(size=(4, 3)), 1e-4

    def after(error: Array) -> Array:
        true_q = multiply(from_rotation_vector(error[:3]), q)
        end = propagate(true_q, gyr - (bias + error[3:]), dt_s)
        off = multiply(end, conjugate(propagate(q, gyr - bias, dt_s)))
        return np.concatenate([to_rotation_vector(off), np.tile(error[3:], (4, 1))], axis=-1)

    step = 1e-4
    found = np.stack([(after(step * e) - after(-step * e)) / (2 * step) for e in np.eye(6)], axis=-1)
    # of first order in the turn during dt
    assert np.allclose(found, transition(to_matrix(q), dt_s), atol=2e-7)


@few
@given(seed=seeds)
def test_the_measurements_have_the_derivatives_that_updates_use(seed: int) -> None:
    """The tilt sees the world's x and y of φ, the azimuth its z: both by finite differences."""
    q, step = attitudes(4, seed), 1e-6

    def measured(error: Array) -> Array:
        # what the filter, still at q, finds when the truth is off by error
        true_q = multiply(from_rotation_vector(error), q)
        tilt = rotate(q, seen(true_q, GRAVITY)) / 9.81
        field = rotate(q, seen(true_q, FIELD_UT))
        return np.stack([tilt[:, 1], -tilt[:, 0], np.arctan2(field[:, 0], field[:, 1])], axis=-1)

    found = np.stack([(measured(step * e) - measured(-step * e)) / (2 * step) for e in np.eye(3)], axis=-1)
    assert np.allclose(found[:, :2], np.eye(3)[:2], atol=1e-8)
    # the azimuth's other two columns are the dip: the inclination is corrected first
    assert np.allclose(found[:, 2, 2], 1.0, atol=1e-8)


@few
@given(seed=seeds)
def test_one_measurement_after_the_other_is_eq_40_for_all_at_once(seed: int) -> None:
    rng = np.random.default_rng(seed)
    p, variance = covariances(5, seed), rng.uniform(0.1, 2.0, size=(5, 3))
    residual = rng.normal(size=(5, 3))
    found, correction = p.copy(), np.zeros((5, 6))
    indices = (0, 1, 4)
    for i, index in enumerate(indices):
        scalar_update(correction, found, index, residual[:, i], variance[:, i])
    h = np.eye(6)[list(indices)]
    for n in range(5):
        gain = p[n] @ h.T @ np.linalg.inv(h @ p[n] @ h.T + np.diag(variance[n]))
        assert np.allclose(correction[n], gain @ residual[n])
        assert np.allclose(found[n], (np.eye(6) - gain @ h) @ p[n])


@few
@given(seed=seeds)
def test_the_heading_update_keeps_an_honest_covariance(seed: int) -> None:
    rng = np.random.default_rng(seed)
    p, variance = covariances(5, seed), rng.uniform(0.1, 2.0, size=5)
    residual, correction = 0.1 * rng.normal(size=5), np.zeros((5, 6))
    found = p.copy()
    turned = heading_update(correction, found, residual, variance)
    assert np.array_equal(correction[:, 2], turned)
    assert not correction[:, [0, 1, 3, 4, 5]].any()
    for n in range(5):
        gain = np.zeros((6, 1))
        gain[2] = p[n, 2, 2] / (p[n, 2, 2] + variance[n])
        left = np.eye(6) - gain @ np.eye(6)[2:3]
        assert np.allclose(found[n], left @ p[n] @ left.T + variance[n] * gain @ gain.T)


def test_an_infinite_variance_takes_nothing() -> None:
    p, correction, never = covariances(3, 0), np.zeros((3, 6)), np.full(3, np.inf)
    found = p.copy()
    scalar_update(correction, found, 4, np.ones(3), never)
    heading_update(correction, found, np.ones(3), never)
    assert np.array_equal(found, p)
    assert not correction.any()


def test_a_heading_residual_goes_the_short_way_round() -> None:
    correction, p = np.zeros((1, 6)), np.eye(6)[None].copy()
    correction[0, 2] = 3.0
    turned = heading_update(correction, p, np.array([-3.0]), np.array([1.0]))
    assert turned[0] == pytest.approx(0.5 * (2 * np.pi - 6.0))


@few
@given(seed=seeds)
def test_a_turn_is_exact_to_second_order_and_of_unit_length(seed: int) -> None:
    phi, q = 0.01 * np.random.default_rng(seed).normal(size=(6, 3)), attitudes(6, seed)
    found = turn_by(phi, q)
    assert np.allclose(np.linalg.norm(found, axis=-1), 1.0, atol=1e-14)
    assert np.max(angle_between(found, multiply(from_rotation_vector(phi), q))) < 1e-5


def test_the_covariance_stays_symmetric_and_positive_over_many_steps() -> None:
    rng = np.random.default_rng(0)
    filter_, truth = EkfFilter(EkfConfig(), RATE_HZ, 4), attitudes(4)
    for _ in range(800):
        rate = rng.normal(size=(4, 3))
        truth = propagate(truth, rate, 1.0 / RATE_HZ)
        filter_.update(rate, seen(truth, GRAVITY) + rng.normal(size=(4, 3)), seen(truth, FIELD_UT))
    p = filter_._state.covariance
    scale = np.sqrt(np.einsum("nii->ni", p))
    unit = p / scale[:, :, None] / scale[:, None, :]
    assert np.allclose(unit, unit.transpose(0, 2, 1), atol=1e-6)
    assert np.min(np.linalg.eigvalsh(0.5 * (unit + unit.transpose(0, 2, 1)))) > -1e-6


def test_prediction_adds_each_density_over_the_time() -> None:
    p = predict(np.zeros((1, 6, 6)), np.eye(3)[None], 0.5, 4.0, 2.0)
    assert np.array_equal(p[0], np.diag([2.0] * 3 + [1.0] * 3))


def test_learns_the_bias_in_motion_without_any_rest() -> None:
    rng = np.random.default_rng(2)
    truth, bias = attitudes(4, 2), np.full((4, 3), 0.02)
    rate_hz = 100.0
    filter_ = EkfFilter(EkfConfig(), rate_hz, 4)
    phase, speed = rng.uniform(0.0, 6.0, (4, 3)), rng.uniform(0.5, 2.0, (4, 3))
    for tick in range(4000):
        rate = np.sin(speed * tick / rate_hz + phase)
        truth = propagate(truth, rate, 1.0 / rate_hz)
        filter_.update(rate + bias, seen(truth, GRAVITY), seen(truth, FIELD_UT))
    assert np.max(np.abs(filter_.bias_rad_s() - bias)) < 2e-3
    assert np.max(angle_between(filter_.q_world_from_sensor(), truth)) < np.radians(0.3)


def test_learns_all_of_the_bias_within_seconds_of_rest() -> None:
    truth, bias = attitudes(4, 3), np.array([[0.01, -0.02, 0.015]] * 4)
    filter_ = EkfFilter(EkfConfig(), RATE_HZ, 4)
    no_field = np.full((4, 3), np.nan)
    for _ in range(1000):
        filter_.update(bias, seen(truth, GRAVITY), no_field)
    assert np.max(np.abs(filter_.bias_rad_s() - bias)) < 1e-3


def test_a_lively_motion_makes_it_lean_on_the_gyro() -> None:
    """The same sideways acceleration tilts less after a second of shaking."""

    def tilt_after(shaken: bool) -> float:
        filter_ = EkfFilter(EkfConfig(), RATE_HZ, 1)
        level, mag, rest = np.array([GRAVITY]), np.array([FIELD_UT]), np.zeros((1, 3))
        for tick in range(1000):
            side = 8.0 * np.sin(2.0 * np.pi * 5.0 * tick / RATE_HZ) if shaken and tick >= 600 else 0.0
            filter_.update(rest, level + [[side, 0.0, 0.0]], mag)
        before = filter_.q_world_from_sensor()
        for _ in range(40):
            filter_.update(rest, level + [[3.0, 0.0, 0.0]], mag)
        return float(angle_between(before, filter_.q_world_from_sensor())[0])

    assert tilt_after(shaken=True) < 0.6 * tilt_after(shaken=False)


def test_a_heading_wrong_by_half_a_turn_comes_right() -> None:
    filter_ = EkfFilter(EkfConfig(), 10.0, 1)
    level = np.array([GRAVITY])
    filter_.update(np.zeros((1, 3)), level, np.array([-FIELD_UT * [1.0, 1.0, -1.0]]))
    for _ in range(2000):
        filter_.update(np.zeros((1, 3)), level, np.array([FIELD_UT + [0.5, 0.0, 0.0]]))
    assert abs(float(heading_rad(filter_.q_world_from_sensor())[0])) < np.radians(3.0)
