"""Gauss-Newton with Levenberg's damping on curved spaces, and steps on the unit sphere."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np

from common.quaternion import Array, cross

State = TypeVar("State")

_FIRST_DAMPING = 1e-3
_MOST_DAMPING = 1e9


@dataclass(frozen=True, slots=True)
class Minimum(Generic[State]):
    """Where the descent ended."""

    state: State
    cost: float
    """Half the sum of squared residuals there."""
    normal: Array
    """(P, P): JᵀJ there, in the local parameters of the last step."""


def gauss_newton(
    linearise: Callable[[State], tuple[Array, Array]],
    step: Callable[[State, Array], State],
    start: State,
    *,
    most_steps: int = 50,
    tolerance: float = 1e-10,
) -> Minimum[State]:
    """Descend from `start`: `linearise` gives residuals (M,) and their Jacobian (M, P) in local parameters.

    `step(state, x)` walks the local parameters x (P,) from a state. A step that does not lower the cost is
    tried again with more damping, so the cost never rises. Ends when a step lowers the cost by less than
    `tolerance` of it.
    """
    state = start
    residual, jacobian = linearise(state)
    cost = 0.5 * float(residual @ residual)
    damping = _FIRST_DAMPING
    for _ in range(most_steps):
        normal, gradient = jacobian.T @ jacobian, jacobian.T @ residual
        # keeps the solution finite where the data say nothing of a parameter
        floor = 1e-12 * (1.0 + float(np.trace(normal)))
        gained = 0.0
        while damping < _MOST_DAMPING:
            damped = normal + np.diag(damping * np.diag(normal) + floor)
            trial = step(state, np.linalg.solve(damped, -gradient).astype(np.float64))
            residual_there, jacobian_there = linearise(trial)
            cost_there = 0.5 * float(residual_there @ residual_there)
            if cost_there < cost:
                gained = cost - cost_there
                state, residual, jacobian, cost = trial, residual_there, jacobian_there, cost_there
                damping = max(0.1 * damping, 1e-12)
                break
            damping *= 10.0
        if gained <= tolerance * cost:
            break
    return Minimum(state, cost, jacobian.T @ jacobian)


def tangents(axis: Array) -> Array:
    """Two orthonormal columns (3, 2) that touch the unit sphere at `axis` (3,)."""
    helper = np.eye(3)[int(np.argmin(np.abs(axis)))]
    first = cross(axis, helper)
    first /= math.sqrt(first @ first)
    return np.array([first, cross(axis, first)]).T


def along_sphere(axis: Array, x: Array) -> Array:
    """The unit vector ‖x‖ rad from `axis` along its `tangents` times x (2,), on the great circle."""
    way = tangents(axis) @ x
    angle = math.sqrt(way @ way)
    out: Array = math.cos(angle) * axis + (math.sin(angle) / angle if angle > 0.0 else 1.0) * way
    return out / math.sqrt(out @ out)


def half_sphere(count: int) -> Array:
    """`count` directions (count, 3) spread evenly over the half sphere z ≥ 0 (Fibonacci's lattice)."""
    k = np.arange(count) + 0.5
    z = k / count
    turn = np.pi * (1.0 + np.sqrt(5.0)) * k
    across = np.sqrt(1.0 - z**2)
    return np.stack([across * np.cos(turn), across * np.sin(turn), z], axis=-1)
