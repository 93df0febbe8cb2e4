"""The magnetometer's hard and soft iron from free rotation (paper B, 2.2.3): an ellipsoid becomes a sphere.

h_o = G⁻¹ (h_s - b). The ellipsoid is fitted with Li and Griffiths' constraint ("Least squares ellipsoid
specific fitting", 2004), a generalised eigenproblem with one positive eigenvalue, then brought to the least
Σ (‖h_o‖ - F)² by Gauss–Newton, which takes off the bias that noise gives the algebraic fit. G⁻¹ is the
symmetric one: of all that make the sphere, it turns directions least.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from common.quaternion import Array
from master.calibrate.uncertainty import covariance, propagate

UNKNOWNS = 9
_SYMMETRIC = np.triu_indices(3)
_BANDS, _SECTORS = 8, 16
CELLS = _BANDS * _SECTORS
_STEPS = 20
_CONSTRAINT_K = 4.0


@dataclass(frozen=True, slots=True)
class Ellipsoid:
    """Readings m lie on ‖shape · (m - centre)‖ = field; det(shape) = 1 keeps µT µT."""

    shape: Array
    """(3, 3), symmetric, positive definite."""
    centre: Array
    """(3,), hard iron, µT."""
    field_ut: float
    """Strength of the field, the mean radius."""

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


def fit_ellipsoid(readings: Array) -> Ellipsoid:
    """The ellipsoid nearest to readings (K ≥ 10, 3). Raises NoEllipsoidError."""
    centre = readings.mean(axis=0)
    scale = float(np.sqrt(np.mean(np.sum((readings - centre) ** 2, axis=1))))
    if not scale > 0.0:
        raise NoEllipsoidError("all readings are the same")
    first = _constrained((readings - centre) / scale)
    found = _refined(first, (readings - centre) / scale)
    return _sized(found[0], centre + scale * found[1], scale)


def parameter_slopes(fit: Ellipsoid, readings: Array) -> Array:
    """Derivatives (K, 9) of the calibrated norm over the field by [shape's upper triangle, centre].

    Here shape is the one that brings readings to the unit sphere, `fit.shape` / `fit.field_ut`.
    """
    return _slopes(fit.shape / fit.field_ut, fit.centre, readings)


def affine_sigma(fit: Ellipsoid, readings: Array) -> Array:
    """1σ of `fit.affine`, (3, 4), from the spread of readings (K, 3) about the fit."""
    slope = parameter_slopes(fit, readings)
    left = fit.norms(readings) / fit.field_ut - 1.0
    cov = covariance(slope, left, len(readings) - UNKNOWNS)
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


def amplification(fit: Ellipsoid, readings: Array) -> float:
    """How far an error of ‖h_o‖ in every cell seen carries into the centre: 1σ over that error.

    1σ of the worst of the centre's axes, were each cell seen one observation with an error of 1. About 0.2
    for the whole sphere; it grows without bound as the part seen gets smaller.
    """
    directions = (readings - fit.centre) @ fit.shape
    _, first = np.unique(cells(directions), return_index=True)
    slope = parameter_slopes(fit, readings[first]) * fit.field_ut
    if len(first) <= UNKNOWNS:
        return float("inf")
    cov = covariance(slope, np.zeros(len(slope)), 1, least_variance=1.0)
    return float(np.sqrt(np.diag(cov)[6:].max()))


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


def _refined(first: tuple[Array, Array], m: Array) -> tuple[Array, Array]:
    """Gauss–Newton on Σ (‖S (m - c)‖ - 1)² from (S, c)."""
    shape, centre = first
    for _ in range(_STEPS):
        left = np.linalg.norm((m - centre) @ shape, axis=1) - 1.0
        step = np.linalg.lstsq(_slopes(shape, centre, m), -left, rcond=None)[0]
        change = np.zeros((3, 3))
        change[_SYMMETRIC] = step[:6]
        change += np.triu(change, 1).T
        shape, centre = shape + change, centre + step[6:]
        if not np.linalg.eigvalsh(shape)[0] > 0.0:
            raise NoEllipsoidError(
                "the fit runs away: the readings cover too little of the sphere, or lie on none"
            )
        if np.abs(step).max() < 1e-10:
            break
    return shape, centre


def _slopes(shape: Array, centre: Array, m: Array) -> Array:
    """Derivatives (K, 9) of ‖S (m - c)‖ by S's upper triangle and c."""
    centred = m - centre
    mapped = centred @ shape
    unit = mapped / np.linalg.norm(mapped, axis=1, keepdims=True)
    i, j = _SYMMETRIC
    product = unit[:, i] * centred[:, j]
    product += np.where(i == j, 0.0, unit[:, j] * centred[:, i])
    return np.hstack([product, -unit @ shape])


def _sized(shape: Array, centre: Array, scale: float) -> Ellipsoid:
    # S / scale takes readings to the unit sphere
    root = float(np.cbrt(np.linalg.det(shape)))
    return Ellipsoid(shape / root, centre, scale / root)
