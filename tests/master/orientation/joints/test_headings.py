from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from master.orientation.joints.headings import Headings


def example(seed: int, count: int = 4) -> tuple[Headings, np.random.Generator]:
    rng = np.random.default_rng(seed)
    headings = Headings(rng.uniform(0.1, 1.0, count), rng.uniform(0.01, 0.1, count))
    headings.theta_rad, headings.drift_rad_s = rng.normal(size=(2, count))
    headings.drift(0.5, 0.01, 0.001)
    return headings, rng


@given(seed=st.integers(0, 10**6))
@settings(max_examples=50, deadline=None, derandomize=True)
def test_it_is_the_textbook_s_kalman_filter(seed: int) -> None:
    """Gains and (I - K H) P, one measurement after the other."""
    headings, rng = example(seed)
    count, dt_s = 4, 0.3
    x = np.concatenate([headings.theta_rad, headings.drift_rad_s])
    f = np.eye(8) + np.diag(np.full(count, dt_s), count)
    p = f @ headings.covariance @ f.T + np.diag(np.repeat([0.02 * dt_s, 0.003 * dt_s], count))
    x = f @ x
    headings.drift(dt_s, 0.02, 0.003)
    h, r, nu = rng.normal(size=(5, count)), rng.uniform(0.1, 2.0, 5), rng.normal(size=5)
    z = h @ headings.theta_rad + nu
    headings.correct((h.T / r) @ h, (h.T / r) @ nu)
    for row, variance, value in zip(h, r, z, strict=True):
        wide = np.concatenate([row, np.zeros(count)])
        gain = p @ wide / (wide @ p @ wide + variance)
        x = x + gain * (value - wide @ x)
        p = p - np.outer(gain, wide @ p)
    np.testing.assert_allclose(np.concatenate([headings.theta_rad, headings.drift_rad_s]), x, atol=1e-9)
    np.testing.assert_allclose(headings.covariance, p, atol=1e-9)


def test_what_nobody_measures_is_held_and_grows_less_sure() -> None:
    """Two nodes of one joint, whose common heading is unknown: only their difference is learnt."""
    headings = Headings(np.full(2, 0.1), np.full(2, 1e-6))
    headings.theta_rad = np.array([0.3, 0.5])
    between = np.array([[1.0, -1.0], [-1.0, 1.0]])
    for _ in range(2000):
        headings.drift(0.1, 1e-4, 0.0)
        error = headings.theta_rad[1] - headings.theta_rad[0] - 0.1
        headings.correct(between, np.array([error, -error]))
    assert headings.theta_rad[1] - headings.theta_rad[0] == pytest.approx(0.1, abs=1e-3)
    assert headings.theta_rad.mean() == pytest.approx(0.4, abs=1e-6)
    assert headings.variance_between(np.array([0]), np.array([1]))[0] < 0.02
    assert headings.variance.min() > 0.05
    assert np.linalg.eigvalsh(headings.covariance).min() > 0.0


def test_a_steady_drift_is_learnt() -> None:
    headings = Headings(np.full(1, 0.1), np.full(1, 0.01))
    for step in range(1, 400):
        headings.drift(0.1, 1e-6, 1e-8)
        headings.correct(np.eye(1) / 0.01, (0.02 * 0.1 * step - headings.theta_rad) / 0.01)
    assert headings.drift_rad_s[0] == pytest.approx(0.02, rel=0.02)
    assert headings.theta_rad[0] == pytest.approx(0.02 * 39.9, abs=1e-3)
