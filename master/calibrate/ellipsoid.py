"""The magnetometer's hard and soft iron from free rotation (paper B, 2.2.3): an ellipsoid becomes a sphere.

h_o = G⁻¹ (h_s - b). The ellipsoid is fitted with Li and Griffiths' constraint ("Least squares ellipsoid
specific fitting", 2004), a generalised eigenproblem with one positive eigenvalue, then brought to the least
sum of a robust loss of the distances in µT (`surface.py`) by Gauss–Newton. An error relative to the
ellipsoid's size would prefer larger ellipsoids where only one side was seen; the distance does not. G⁻¹ is
the symmetric one: of all that make the sphere, it turns directions least.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from common.quaternion import Array
from master.calibrate.accelerometer import sphere
from master.calibrate.surface import Parameters, RunsAwayError, distances, refined, slopes_of_norm, weights
from master.calibrate.uncertainty import covariance, propagate

UNKNOWNS = 9
_SYMMETRIC = np.triu_indices(3)
_BANDS, _SECTORS = 8, 16
CELLS = _BANDS * _SECTORS
_CONSTRAINT_K = 4.0
_SUBSETS, _SUBSET, _SCORED = 80, 40, 2000
"""Random subsets to start from where all readings together give none: outliers steer the algebraic fit."""


@dataclass(frozen=True, slots=True)
class Ellipsoid:
    """Readings m lie on ‖shape · (m - centre)‖ = field; det(shape) = 1 keeps µT µT."""

    shape: Array
    """(3, 3), symmetric, positive definite."""
    centre: Array
    """(3,), hard iron, µT."""
    field_ut: float
    """Strength of the field, the mean radius."""
    refined: bool = True
    """False: the least distances ran away, and this is the algebraic solution."""

    def norms(self, readings: Array) -> Array:
        """Strength of the calibrated readings (K, 3), µT, (K,)."""
        out: Array = np.linalg.norm((readings - self.centre) @ self.shape, axis=1)
        return out

    @property
    def affine(self) -> Array:
        """(3, 4), as a node's file has it."""
        return np.column_stack([self.shape, -self.shape @ self.centre])


class NoEllipsoidError(ValueError):
    """The readings lie on no ellipsoid."""


def fit_ellipsoid(readings: Array, near: Ellipsoid | None = None) -> Ellipsoid:
    """The ellipsoid nearest to readings (K ≥ 10, 3), whatever a few of them are. Raises NoEllipsoidError.

    With one that is `near` already, as of most of these readings, the search begins there.
    """
    centre = np.median(readings, axis=0)
    scale = 1.5 * float(np.median(np.linalg.norm(readings - centre, axis=1)))
    if not scale > 0.0:
        raise NoEllipsoidError("all readings are the same")
    m = (readings - centre) / scale
    if near is None:
        starts = [_start(m), _sphere(m)]
    else:
        starts = [(near.shape * scale / near.field_ut, (near.centre - centre) / scale)]
    trials = []
    for start in starts:
        try:
            trials.append(refined(start, m))
        except RunsAwayError:
            continue
    if not trials:
        return _sized(starts[0], centre, scale, sound=False)
    return _sized(min(trials, key=lambda trial: _median_off(trial, m)), centre, scale, sound=True)


def _median_off(parameters: Parameters, m: Array) -> float:
    return float(np.median(np.abs(distances(parameters, m))))


def _sphere(m: Array) -> Parameters:
    """The sphere that fits best, outliers left out: rounder than iron makes it, and so a safe start."""
    centre, radius = sphere(m)
    for _ in range(5):
        off = np.abs(np.linalg.norm(m - centre, axis=1) - radius)
        centre, radius = sphere(m[off <= max(3.0 * float(np.median(off)), 1e-9)])
    return np.eye(3) / max(radius, 1e-9), centre


def _start(m: Array) -> Parameters:
    """Of the algebraic fits to all readings and to random few, the one whose median distance is the least."""
    scored = m[:: max(1, len(m) // _SCORED)]
    rng = np.random.default_rng(0)
    found: list[tuple[float, Parameters]] = []
    problem = NoEllipsoidError("no ellipsoid fits the readings")
    for n in range(_SUBSETS + 1):
        few = m if n == 0 else m[rng.choice(len(m), _SUBSET, replace=False)]
        try:
            trial = _constrained(few)
        except NoEllipsoidError as error:
            problem = error if n == 0 else problem
            continue
        left = np.abs(distances(trial, scored))
        found.append((float(np.median(left)), trial))
        # without outliers the fit to all is the best, and no other need be looked for
        if len(m) <= 2 * _SUBSET or (n == 0 and np.max(left) < 6.0 * np.sqrt(np.mean(left**2))):
            break
    if not found:
        raise problem
    return min(found, key=lambda one: one[0])[1]


def parameter_slopes(fit: Ellipsoid, readings: Array) -> Array:
    """Derivatives (K, 9) of the calibrated norm over the field by [shape's upper triangle, centre].

    Here shape is the one that brings readings to the unit sphere, `fit.shape` / `fit.field_ut`.
    """
    return slopes_of_norm((fit.shape / fit.field_ut, fit.centre), readings)


def spread_ut(fit: Ellipsoid, readings: Array) -> float:
    """Standard deviation of the readings' distances from the ellipsoid, outliers left out, µT."""
    left = off_ut(fit, readings)
    return float(1.4826 * np.median(np.abs(left - np.median(left))))


def off_ut(fit: Ellipsoid, readings: Array) -> Array:
    """Distances (K,) of readings (K, 3) from the ellipsoid, µT; positive outside."""
    return distances((fit.shape / fit.field_ut, fit.centre), readings)


def affine_sigma(fit: Ellipsoid, readings: Array) -> Array:
    """1σ of `fit.affine`, (3, 4), from the spread of readings (K, 3) about the fit."""
    unit = fit.shape / fit.field_ut
    left = distances((unit, fit.centre), readings)
    # near the surface a distance changes as the norm does, over the norm's steepness
    mapped = (readings - fit.centre) @ unit
    steepness = np.linalg.norm(mapped @ unit, axis=1) / np.linalg.norm(mapped, axis=1)
    root = np.sqrt(weights(left))
    slope = parameter_slopes(fit, readings) / steepness[:, None]
    # a robust fit of Gaussian readings is known 5 % worse than the plain one: by the weights' own slope
    effective = float(np.mean(root**2))
    cov = covariance(root[:, None] * slope, root * left, len(readings) - UNKNOWNS) / max(effective, 0.1)
    to_affine = np.zeros((12, UNKNOWNS))
    for n, (i, j) in enumerate(zip(*_SYMMETRIC, strict=True)):
        basis = np.zeros((3, 3))
        basis[i, j] = basis[j, i] = fit.field_ut
        # the field's strength is the radius of det(shape) = 1: it changes with the trace
        basis -= fit.shape * np.trace(np.linalg.solve(fit.shape, basis)) / 3.0
        to_affine[:, n] = np.column_stack([basis, -basis @ fit.centre]).ravel()
    to_affine[3::4, 6:] = -fit.shape
    return propagate(cov, to_affine).reshape(3, 4)


def cells(directions: Array) -> NDArray[np.intp]:
    """Which of `CELLS` cells of equal area on the sphere each direction (K, 3) falls in, (K,)."""
    unit = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    # equal steps of z are equal areas (Archimedes)
    band = np.clip(((unit[:, 2] + 1.0) / 2.0 * _BANDS).astype(np.intp), 0, _BANDS - 1)
    turn = np.arctan2(unit[:, 1], unit[:, 0]) / (2.0 * np.pi) % 1.0
    sector = np.clip((turn * _SECTORS).astype(np.intp), 0, _SECTORS - 1)
    out: NDArray[np.intp] = band * _SECTORS + sector
    return out


def coverage(fit: Ellipsoid, readings: Array) -> float:
    """Share of the sphere's cells that the calibrated readings (K, 3) have seen, 0 to 1."""
    seen = np.unique(cells((readings - fit.centre) @ fit.shape))
    return len(seen) / CELLS


def _constrained(m: Array) -> tuple[Array, Array]:
    """The algebraic fit: unit-sphere shape (3, 3) and centre (3,)."""
    from scipy.linalg import eig

    x, y, z = m.T
    squares, products = (x * x, y * y, z * z), (2 * y * z, 2 * x * z, 2 * x * y)
    design = np.stack([*squares, *products, 2 * x, 2 * y, 2 * z, np.ones_like(x)])
    scatter = design @ design.T / len(m)
    constraint = np.zeros((6, 6))
    constraint[:3, :3] = 0.5 * _CONSTRAINT_K - 1.0
    constraint[np.arange(3), np.arange(3)] = -1.0
    constraint[np.arange(3, 6), np.arange(3, 6)] = -_CONSTRAINT_K
    lower = scatter[6:, 6:]
    try:
        linear = np.linalg.solve(lower, scatter[6:, :6])
    except np.linalg.LinAlgError:
        raise NoEllipsoidError("the readings lie in a plane") from None
    values, vectors = eig(scatter[:6, :6] - scatter[:6, 6:] @ linear, constraint)
    # of the six exactly one is positive; without noise it is 0 to rounding
    real = np.real(values)
    usable = np.isfinite(real) & (np.abs(np.imag(values)) <= 1e-9 * (1.0 + np.abs(real)))
    if not usable.any():
        raise NoEllipsoidError("no ellipsoid fits the readings")
    best = int(np.argmax(np.where(usable, real, -np.inf)))
    a = np.real(vectors[:, best])
    u = -linear @ a
    quadratic = np.array([[a[0], a[5], a[4]], [a[5], a[1], a[3]], [a[4], a[3], a[2]]])
    return _from_quadric(quadratic, u[:3], float(u[3]))


def _from_quadric(quadratic: Array, linear: Array, constant: float) -> tuple[Array, Array]:
    """Of xᵀ Q x + 2 lᵀ x + c = 0."""
    if np.trace(quadratic) < 0.0:
        quadratic, linear, constant = -quadratic, -linear, -constant
    try:
        centre = -np.linalg.solve(quadratic, linear)
    except np.linalg.LinAlgError:
        raise NoEllipsoidError("no ellipsoid fits the readings") from None
    radius_squared = float(centre @ quadratic @ centre - constant)
    values, vectors = np.linalg.eigh(quadratic)
    if not (values[0] > 1e-9 * values[-1] and radius_squared > 0.0):
        raise NoEllipsoidError("the quadric nearest to the readings is no ellipsoid")
    shape: Array = vectors * np.sqrt(values / radius_squared) @ vectors.T
    return shape, centre.astype(np.float64)


def _sized(found: Parameters, middle: Array, scale: float, *, sound: bool) -> Ellipsoid:
    # S / scale takes readings to the unit sphere
    shape, centre = found
    root = float(np.cbrt(np.linalg.det(shape)))
    return Ellipsoid(shape / root, middle + scale * centre, scale / root, sound)
