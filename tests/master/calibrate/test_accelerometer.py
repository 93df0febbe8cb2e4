from functools import partial

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import approx_fprime
from scipy.stats import f as f_distribution

from common.quaternion import Array
from master.calibrate.accelerometer import (
    START,
    determined,
    fit_accelerometer,
    jacobian,
    nominal,
    residuals,
    sphere,
)

G = 9.80665


def attitudes(count: int, seed: int) -> Array:
    v = np.random.default_rng(seed).normal(size=(count, 3))
    out: Array = G * v / np.linalg.norm(v, axis=1, keepdims=True)
    return out


def unit_of(seed: int) -> tuple[Array, Array]:
    """Gain (upper triangular) and bias of a unit as delivered."""
    rng = np.random.default_rng([seed, 1])
    return np.eye(3) + np.triu(rng.uniform(-0.05, 0.05, (3, 3))), rng.uniform(-0.8, 0.8, 3)


def theta_of(gain: Array, bias: Array) -> Array:
    return np.concatenate([gain[np.triu_indices(3)], bias])


def residual(reading: Array, theta: Array) -> float:
    return float(residuals(theta, reading, G)[0])


def test_derivatives_are_those_of_differences() -> None:
    gain, bias = unit_of(3)
    theta, readings = theta_of(gain, bias), attitudes(7, 0)
    for k, row in enumerate(jacobian(theta, readings)):
        numeric = approx_fprime(theta, partial(residual, readings[k : k + 1]), 1e-6)
        assert np.allclose(row, numeric, rtol=1e-5, atol=1e-4)


@settings(max_examples=60, deadline=None, derandomize=True)
@given(st.integers(0, 10_000), st.integers(15, 40))
def test_a_known_error_is_found_within_the_stated_uncertainty(seed: int, count: int) -> None:
    gain, bias = unit_of(seed)
    noise = np.random.default_rng([seed, 2]).normal(scale=2e-3, size=(count, 3))
    readings = attitudes(count, seed) @ np.linalg.inv(gain).T - bias + noise
    fit = fit_accelerometer(readings, G, START)
    off = fit.theta - theta_of(gain, bias)
    # the nine parameters' joint distance in units of their stated covariance is F-distributed
    distance = off @ np.linalg.solve(fit.cov, off) / 9
    assert distance < f_distribution.isf(1e-5, 9, count - 9)


def test_the_stated_uncertainty_is_neither_too_large() -> None:
    gain, bias = unit_of(1)
    offs, maps = [], []
    for seed in range(60):
        noise = np.random.default_rng([seed, 3]).normal(scale=2e-3, size=(30, 3))
        fit = fit_accelerometer(attitudes(30, 5) @ np.linalg.inv(gain).T - bias + noise, G, START)
        offs.append((fit.theta - theta_of(gain, bias)) / fit.sigma)
        true = np.column_stack([gain, gain @ bias])
        maps.append(((fit.affine - true) / np.where(fit.affine_sigma > 0, fit.affine_sigma, 1)).ravel())
    used = np.abs(np.array(maps)).max(axis=0) > 0
    assert np.all((np.std(offs, axis=0) > 0.7) & (np.std(offs, axis=0) < 1.4))
    spread = np.std(maps, axis=0)[used]
    assert used.sum() == 9
    assert np.all((spread > 0.7) & (spread < 1.4))


def test_without_noise_the_map_undoes_the_error() -> None:
    gain, bias = unit_of(8)
    truth = attitudes(20, 1)
    readings = truth @ np.linalg.inv(gain).T - bias
    fit = fit_accelerometer(readings, G, START)
    assert np.allclose(readings @ fit.affine[:, :3].T + fit.affine[:, 3], truth, atol=1e-9)
    assert np.abs(fit.hold_out_m_s2).max() < 1e-9


def test_held_out_errors_are_larger_than_those_fitted() -> None:
    readings = attitudes(20, 1) + np.random.default_rng(0).normal(scale=2e-3, size=(20, 3))
    fit = fit_accelerometer(readings, G, START)
    assert np.std(fit.hold_out_m_s2) > 1.2 * np.std(fit.residuals_m_s2)


def test_a_sphere_is_found() -> None:
    centre, radius = sphere(attitudes(10, 0) + [5.0, -3.0, 1.0])
    assert np.allclose(centre, [5.0, -3.0, 1.0])
    assert np.isclose(radius, G)


def test_counts_of_an_unsigned_converter_have_their_zero_in_the_middle() -> None:
    theta = nominal(32768.0 + 415.0 * attitudes(20, 0), G, counts=True)
    assert np.allclose(theta[[0, 3, 5]], 1 / 415.0)
    assert np.allclose(theta[6:], -32768.0)


def test_attitudes_in_a_plane_determine_nothing() -> None:
    turn = np.linspace(0, 2 * np.pi, 20, endpoint=False)
    flat = G * np.column_stack([np.cos(turn), np.sin(turn), np.zeros(20)])
    assert max(determined(START, flat, G, 0.01)) > 1e3
    assert max(determined(START, attitudes(20, 0), G, 0.01)) < 0.03
