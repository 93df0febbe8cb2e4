from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import f as f_distribution

from common.quaternion import Array, conjugate, from_rotation_vector, rotate
from master.calibrate.gyroscope import Moves, fit_gyroscope, gravity_errors, nominal_scale, predicted

DT_S = 0.05
STEPS = 20


def moves(gain: Array, count: int, seed: int, noise_rad: float = 0.0) -> Moves:
    """Even turns about random axes, of which a gyro in need of `gain` reads; gravity after it with noise."""
    rng = np.random.default_rng(seed)
    before, turn = rng.normal(size=(2, count, 3))
    before /= np.linalg.norm(before, axis=1, keepdims=True)
    after = rotate(conjugate(from_rotation_vector(turn)), before)
    after += noise_rad * rng.normal(size=after.shape)
    after /= np.linalg.norm(after, axis=1, keepdims=True)
    reading = turn / (STEPS * DT_S) @ np.linalg.inv(gain).T
    pairs = np.repeat(np.stack([reading, reading], axis=1), STEPS, axis=0)
    return Moves(pairs, np.full(count, STEPS), before, after, DT_S)


def some_gain(seed: int) -> Array:
    out: Array = np.eye(3) + np.random.default_rng([seed, 1]).uniform(-0.05, 0.05, (3, 3))
    return out


STILL: Array = np.array([[0.1, -0.2, 0.3], [0.12, -0.2, 0.28], [0.08, -0.2, 0.32]])
NO_NOISE: Array = np.zeros(3)


def test_derivatives_are_those_of_differences() -> None:
    turned = moves(some_gain(0), 4, 0)
    _, slope = predicted(np.eye(3), turned)
    for n in range(9):
        step = np.zeros(9)
        step[n] = 1e-6
        ahead, _ = predicted(np.eye(3) + step.reshape(3, 3), turned)
        behind, _ = predicted(np.eye(3) - step.reshape(3, 3), turned)
        assert np.allclose(slope[:, :, n], (ahead - behind) / 2e-6, atol=1e-8)


def test_without_noise_the_gain_is_found() -> None:
    gain = some_gain(4)
    fit = fit_gyroscope(moves(gain, 15, 2), STILL, NO_NOISE)
    assert np.allclose(fit.gain, gain, atol=1e-7)
    assert np.allclose(fit.bias, [-0.1, 0.2, -0.3])
    assert np.allclose(fit.affine, np.column_stack([gain, gain @ fit.bias]), atol=1e-7)
    assert fit.hold_out_rad.max() < 1e-6


@settings(max_examples=25, deadline=None, derandomize=True)
@given(st.integers(0, 10_000), st.integers(12, 40))
def test_a_known_error_is_found_within_the_stated_uncertainty(seed: int, count: int) -> None:
    gain = some_gain(seed)
    fit = fit_gyroscope(moves(gain, count, seed, noise_rad=2e-3), STILL, NO_NOISE)
    off = (fit.gain - gain).ravel()
    distance = off @ np.linalg.solve(fit.gain_cov, off) / 9
    assert distance < f_distribution.isf(1e-5, 9, 2 * count - 9)


def test_the_stated_uncertainty_is_neither_too_large() -> None:
    gain = some_gain(1)
    offs = []
    for seed in range(20):
        fit = fit_gyroscope(moves(gain, 20, seed, noise_rad=2e-3), STILL, NO_NOISE)
        offs.append((fit.gain - gain) / fit.sigma)
    assert 0.75 < np.std(offs) < 1.3


def test_the_bias_is_no_surer_than_the_noise_and_the_rests_allow() -> None:
    turned = moves(np.eye(3), 15, 0)
    spread = fit_gyroscope(turned, STILL, np.array([0.0, 0.005, 0.0])).bias_sigma
    assert np.allclose(spread, [0.02 / np.sqrt(3), 0.005, 0.02 / np.sqrt(3)])
    affine = fit_gyroscope(turned, STILL, NO_NOISE).affine_sigma
    assert affine.shape == (3, 4)
    assert affine[0, 3] >= 0.99 * 0.02 / np.sqrt(3)


@pytest.mark.parametrize("unit", [1.0, np.pi / 180, 1 / 6258, 2000 * np.pi / 180 / 32768])
def test_the_unit_of_the_readings_is_found(unit: float) -> None:
    scale = nominal_scale(moves(unit * some_gain(2), 20, 3))
    assert 0.93 < scale / unit < 1.07
    fit = fit_gyroscope(moves(unit * some_gain(2), 20, 3), STILL, NO_NOISE, scale)
    assert np.allclose(fit.gain, unit * some_gain(2), rtol=0, atol=1e-6 * unit)


def test_the_error_is_the_angle_of_gravity() -> None:
    turned = moves(np.eye(3), 3, 0)
    off = rotate(from_rotation_vector(np.array([0.0, 0.0, 0.3])), np.array([[1.0, 0.0, 0.0]]))
    tilted = Moves(0 * turned.pairs, turned.counts, np.tile([1.0, 0, 0], (3, 1)), np.tile(off, (3, 1)), DT_S)
    assert np.allclose(gravity_errors(np.eye(3), tilted), 0.3)


def test_progress_reaches_the_end() -> None:
    heard: list[float] = []
    hear: Callable[[float], None] = heard.append
    fit_gyroscope(moves(np.eye(3), 15, 0), STILL, NO_NOISE, progress=hear)
    assert heard == sorted(heard)
    assert heard[-1] == pytest.approx(1.0)
