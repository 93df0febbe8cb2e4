import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import f as f_distribution

from common.quaternion import Array
from master.calibrate.ellipsoid import (
    CELLS,
    NoEllipsoidError,
    affine_sigma,
    cells,
    coverage,
    fit_ellipsoid,
    parameter_slopes,
)
from master.calibrate.uncertainty import covariance

FIELD_UT = 48.0


def directions(count: int, seed: int, lowest_z: float = -1.0) -> Array:
    v = np.random.default_rng(seed).normal(size=(8 * count, 3))
    v /= np.linalg.norm(v, axis=1, keepdims=True)
    out: Array = v[v[:, 2] >= lowest_z][:count]
    return out


def iron(seed: int) -> tuple[Array, Array]:
    """Symmetric shape of determinant 1 and hard iron, µT."""
    rng = np.random.default_rng([seed, 1])
    half = rng.uniform(-0.1, 0.1, (3, 3))
    shape = np.eye(3) + half + half.T
    return shape / np.cbrt(np.linalg.det(shape)), rng.uniform(-60.0, 60.0, 3)


def distorted(v: Array, shape: Array, centre: Array, noise_ut: float = 0.0, seed: int = 0) -> Array:
    noise = np.random.default_rng([seed, 2]).normal(scale=1.0, size=v.shape)
    out: Array = FIELD_UT * v @ np.linalg.inv(shape) + centre + noise_ut * noise
    return out


@settings(max_examples=40, deadline=None, derandomize=True)
@given(st.integers(0, 10_000))
def test_without_noise_iron_is_found(seed: int) -> None:
    shape, centre = iron(seed)
    fit = fit_ellipsoid(distorted(directions(200, seed), shape, centre))
    assert np.allclose(fit.shape, shape, atol=1e-7)
    assert np.allclose(fit.centre, centre, atol=1e-5)
    assert fit.field_ut == pytest.approx(FIELD_UT, rel=1e-7)
    assert np.linalg.det(fit.affine[:, :3]) == pytest.approx(1.0)


@settings(max_examples=40, deadline=None, derandomize=True)
@given(st.integers(0, 10_000), st.integers(200, 2000))
def test_known_iron_is_found_within_the_stated_uncertainty(seed: int, count: int) -> None:
    shape, centre = iron(seed)
    readings = distorted(directions(count, seed), shape, centre, 0.2, seed)
    fit = fit_ellipsoid(readings)
    left = fit.norms(readings) / fit.field_ut - 1.0
    cov = covariance(parameter_slopes(fit, readings), left, count - 9)
    off_shape = fit.shape / fit.field_ut - shape / FIELD_UT
    off = np.concatenate([off_shape[np.triu_indices(3)], fit.centre - centre])
    scale = np.sqrt(np.diag(cov))
    distance = (off / scale) @ np.linalg.solve(cov / np.outer(scale, scale), off / scale) / 9
    assert distance < f_distribution.isf(1e-5, 9, count - 9)


def test_the_stated_uncertainty_of_the_map_is_neither_too_large() -> None:
    shape, centre = iron(3)
    true = np.column_stack([shape, -shape @ centre])
    offs = []
    for seed in range(60):
        readings = distorted(directions(300, 9), shape, centre, 0.2, seed)
        fit = fit_ellipsoid(readings)
        offs.append((fit.affine - true) / affine_sigma(fit, readings))
    spread = np.std(offs, axis=0)
    assert np.all((spread > 0.7) & (spread < 1.4))


def test_noise_does_not_shrink_the_fit_where_readings_crowd() -> None:
    """What Gauss–Newton is for: the algebraic fit alone is off by more than this."""
    shape, centre = iron(5)
    crowd = np.concatenate([directions(3000, 0, 0.8), directions(3000, 1, 0.8), directions(300, 2)])
    readings = distorted(crowd, shape, centre, 1.0)
    fit = fit_ellipsoid(readings)
    sigma = affine_sigma(fit, readings)
    true = np.column_stack([shape, -shape @ centre])
    assert np.all(np.abs(fit.affine - true) < 4 * sigma)


def test_derivatives_are_those_of_differences() -> None:
    shape, centre = iron(2)
    readings = distorted(directions(20, 0), shape, centre, 1.0)
    fit = fit_ellipsoid(readings)
    slope = parameter_slopes(fit, readings)
    upper = np.triu_indices(3)
    for n in range(9):
        step = 1e-7 if n < 6 else 1e-4

        def norms(sign: float, n: int = n, step: float = step) -> Array:
            unit, middle = fit.shape / fit.field_ut, fit.centre.copy()
            if n < 6:
                i, j = upper[0][n], upper[1][n]
                unit[i, j] += sign * step
                unit[j, i] = unit[i, j]
            else:
                middle[n - 6] += sign * step
            out: Array = np.linalg.norm((readings - middle) @ unit, axis=1)
            return out

        assert np.allclose(slope[:, n], (norms(1.0) - norms(-1.0)) / (2 * step), rtol=1e-5, atol=1e-5)


def test_cells_are_of_equal_area() -> None:
    counts = np.bincount(cells(directions(64_000, 0)), minlength=CELLS)
    assert len(counts) == CELLS
    assert np.all(np.abs(counts - 500) < 5 * np.sqrt(500))


def test_coverage() -> None:
    shape, centre = iron(0)
    parts = [distorted(directions(5000, 0, z), shape, centre) for z in (-1.0, 0.0, 0.7)]
    seen = [coverage(fit_ellipsoid(p), p) for p in parts]
    assert seen[0] == 1.0
    assert seen[1] == pytest.approx(0.5, abs=0.1)
    assert seen[2] < 0.3


def test_what_lies_on_no_ellipsoid_is_refused() -> None:
    flat = directions(200, 0) * [1.0, 1.0, 0.0]
    with pytest.raises(NoEllipsoidError):
        fit_ellipsoid(flat)
    with pytest.raises(NoEllipsoidError):
        fit_ellipsoid(np.ones((50, 3)))
