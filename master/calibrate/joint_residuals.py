"""What the samples of two neighbouring units say against a guess of their joint: residuals and Jacobian.

The equations, and what is sought, stand at the head of `joint_fit.py`. Each kind of residual is in units of
what it may be on a person, so that all kinds count alike.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from common.quaternion import Array, heading_turn, to_matrix
from master.calibrate.gauss_newton import along_sphere, gauss_newton, tangents

ALIGNED_RAD = math.radians(6.0)
"""How far soft tissue and anatomy turn a segment's axis from the ideal joint's."""
RATE_RAD_S = 0.3
ACCELERATION_M_S2 = 0.6
"""The same for rates and for the joint centre's acceleration."""
ZERO_POSE_RAD = math.radians(8.0)
"""How far an axis, while the person stands in the zero pose, is from where the skeleton has it there."""
_ZERO_POSE_SHARE = 0.25
"""Standing in the zero pose counts as much as this share of all samples."""
LEVER_M = 0.3
_HUBER = 2.0
"""Residuals beyond so many standard deviations count by their size, not its square."""


Rows = NDArray[np.intp]


@dataclass(frozen=True, slots=True)
class Moving:
    """One unit over the moving part of a recording, (K, ...) samples, and in the zero pose."""

    r: Array
    """(K, 3, 3) rotation matrices, own earth frame from sensor."""
    rate: Array
    """(K, 3) rad/s, own earth frame, low-passed."""
    acc: Array
    """(K, 3) m/s², specific force in the own earth frame, low-passed."""
    lever: Array
    """(K, 3, 3): times r, the acceleration of the sensor against a point it is r away from, earth frame."""
    r_zero_pose: Array
    """(3, 3)."""

    def some(self, rows: Rows) -> Moving:
        """The samples of these rows."""
        return replace(self, r=self.r[rows], rate=self.rate[rows], acc=self.acc[rows], lever=self.lever[rows])


Axes = tuple[Array, Array]


@dataclass(frozen=True, slots=True)
class Unknowns:
    """What is sought between two neighbours; axes None for a ball joint."""

    axes: tuple[Array, Array] | None
    offset_rad: float
    levers_m: Array
    """(6,)."""


class JointProblem:
    """Residuals and Jacobian of one joint over some samples."""

    def __init__(self, parent: Moving, child: Moving, zero_axes: Sequence[Array] | None, stood: bool) -> None:
        self._1, self._2, self._zero_axes, self._stood = parent, child, zero_axes, stood
        self.rows = 0

    def descend(self, start: Unknowns, most_steps: int) -> tuple[Unknowns, float, Array]:
        """The minimum below a start, its cost and the normal matrix JᵀJ there."""
        minimum = gauss_newton(self.linearise, step, start, most_steps=most_steps, tolerance=1e-6)
        return minimum.state, minimum.cost, minimum.normal

    def linearise(self, unknowns: Unknowns) -> tuple[Array, Array]:
        """Robust residuals (M,) and Jacobian (M, P)."""
        pieces = self._pieces(unknowns)
        residual = np.concatenate([p[0].reshape(-1) for p in pieces])
        jacobian = np.concatenate([p[1].reshape(-1, p[1].shape[-1]) for p in pieces])
        self.rows = len(residual)
        residual, jacobian = _huber(residual, jacobian)
        if unknowns.axes is None or not self._stood:
            return residual, jacobian
        standing, slope = self._zero_pose(unknowns.axes, jacobian.shape[1])
        return np.concatenate([residual, standing]), np.concatenate([jacobian, slope])

    def by_sample(self, unknowns: Unknowns) -> tuple[Array, Array, Array]:
        """Of each sample the gradient Jᵀr (K, P) and the normal matrix JᵀJ (K, P, P); (P, P) the prior's."""
        *pieces, (_, prior) = self._pieces(unknowns)
        count = len(self._1.r)
        residual = np.concatenate([p[0].reshape(count, -1) for p in pieces], axis=1)
        jacobian = np.concatenate([p[1].reshape(count, -1, p[1].shape[-1]) for p in pieces], axis=1)
        shape = jacobian.shape
        tame, slope = _huber(residual.reshape(-1), jacobian.reshape(-1, shape[-1]))
        tame, slope = tame.reshape(residual.shape), slope.reshape(shape)
        return (
            np.einsum("kmp,km->kp", slope, tame),
            np.einsum("kmp,kmq->kpq", slope, slope),
            prior.T @ prior,
        )

    def misfit(self, unknowns: Unknowns) -> dict[str, float]:
        """RMS of each kind of residual in its own unit."""
        kinds = ["acceleration"] if unknowns.axes is None else ["acceleration", "aligned", "rate"]
        scales = {"aligned": ALIGNED_RAD, "rate": RATE_RAD_S, "acceleration": ACCELERATION_M_S2}
        pieces = self._pieces(unknowns)
        return {
            kind: scales[kind] * float(np.sqrt(np.mean(np.sum(np.atleast_2d(p[0]) ** 2, axis=-1))))
            if p[0].ndim > 1
            else scales[kind] * float(np.sqrt(np.mean(p[0] ** 2)))
            for kind, p in zip(kinds, pieces, strict=False)
        }

    def _pieces(self, unknowns: Unknowns) -> list[tuple[Array, Array]]:
        """Residuals (..., ) with Jacobians (..., P) over [j1 2, j2 2,] δ, r1 3, r2 3."""
        one, two = self._1, self._2
        turn = to_matrix(heading_turn(unknowns.offset_rad))
        first = 0 if unknowns.axes is None else 4
        size = first + 7
        pieces = [_levers_prior(unknowns, first, size)]
        pieces.insert(0, _acceleration(one, two, turn, unknowns.levers_m, first, size))
        if unknowns.axes is None:
            return pieces
        assert self._zero_axes is not None
        axis1, axis2 = unknowns.axes
        u, v = one.r @ axis1, (two.r @ axis2) @ turn.T
        du = one.r @ tangents(axis1)
        dv = turn @ (two.r @ tangents(axis2))
        relative = one.rate - two.rate @ turn.T
        drelative = -_across_up(two.rate @ turn.T)
        joint = _hinge if len(self._zero_axes) == 1 else _two_axes
        cosine = float(self._zero_axes[0] @ self._zero_axes[-1])
        pieces[1:1] = joint(u, v, du, dv, relative, drelative, cosine, size)
        return pieces

    def _zero_pose(self, axes: tuple[Array, Array], size: int) -> tuple[Array, Array]:
        """Each axis is as steep as in the skeleton's zero pose; a level one has either sign."""
        assert self._zero_axes is not None
        # it speaks once, beside samples of which many say the same
        weight = math.sqrt(max(1.0, len(self._1.r) * _ZERO_POSE_SHARE)) / ZERO_POSE_RAD
        residual, jacobian = np.zeros(2), np.zeros((2, size))
        zero_poses = (self._1.r_zero_pose, self._2.r_zero_pose)
        zero = (self._zero_axes[0], self._zero_axes[-1])
        for i in range(2):
            residual[i] = weight * (zero_poses[i] @ axes[i] - zero[i])[2]
            jacobian[i, 2 * i : 2 * i + 2] = weight * (zero_poses[i] @ tangents(axes[i]))[2]
        return residual, jacobian


def step(unknowns: Unknowns, x: Array) -> Unknowns:
    """A guess moved by x (P,): two along each axis' sphere, the offset, six for the levers."""
    if unknowns.axes is None:
        return Unknowns(None, unknowns.offset_rad + float(x[0]), unknowns.levers_m + x[1:])
    axes = (along_sphere(unknowns.axes[0], x[:2]), along_sphere(unknowns.axes[1], x[2:4]))
    return Unknowns(axes, unknowns.offset_rad + float(x[4]), unknowns.levers_m + x[5:])


def _across_up(v: Array) -> Array:
    """Z × v, (..., 3): the change of a turned vector with the turn's heading."""
    out = np.zeros_like(v)
    out[..., 0], out[..., 1] = -v[..., 1], v[..., 0]
    return out


def _acceleration(
    one: Moving, two: Moving, turn: Array, levers_m: Array, first: int, size: int
) -> tuple[Array, Array]:
    there = (two.acc - two.lever @ levers_m[3:]) @ turn.T
    jacobian = np.zeros((*there.shape, size))
    jacobian[..., first] = -_across_up(there)
    jacobian[..., first + 1 : first + 4] = -one.lever
    jacobian[..., first + 4 :] = turn @ two.lever
    residual = one.acc - one.lever @ levers_m[:3] - there
    return residual / ACCELERATION_M_S2, jacobian / ACCELERATION_M_S2


def _levers_prior(unknowns: Unknowns, first: int, size: int) -> tuple[Array, Array]:
    jacobian = np.zeros((6, size))
    jacobian[:, first + 1 :] = np.eye(6) / LEVER_M
    return unknowns.levers_m / LEVER_M, jacobian


def _hinge(
    u: Array, v: Array, du: Array, dv: Array, d: Array, dd: Array, _cosine: float, size: int
) -> list[tuple[Array, Array]]:
    aligned = np.zeros((*u.shape, size))
    aligned[..., :2], aligned[..., 2:4], aligned[..., 4] = du, -dv, -_across_up(v)
    # the part of the relative rate across the axis: d − u (u·d)
    along = np.einsum("ti,ti->t", u, d)
    rate = np.zeros((*u.shape, size))
    rate[..., :2] = -du * along[:, None, None] - u[..., None] * np.einsum("tik,ti->tk", du, d)[:, None]
    rate[..., 4] = dd - u * np.einsum("ti,ti->t", u, dd)[:, None]
    return [
        ((u - v) / ALIGNED_RAD, aligned / ALIGNED_RAD),
        ((d - u * along[:, None]) / RATE_RAD_S, rate / RATE_RAD_S),
    ]


def _two_axes(
    u: Array, v: Array, du: Array, dv: Array, d: Array, dd: Array, cosine: float, size: int
) -> list[tuple[Array, Array]]:
    dv_offset = _across_up(v)
    aligned = np.zeros((len(u), size))
    aligned[:, :2] = np.einsum("tik,ti->tk", du, v)
    aligned[:, 2:4] = np.einsum("tik,ti->tk", dv, u)
    aligned[:, 4] = np.einsum("ti,ti->t", u, dv_offset)
    n = np.cross(u, v)
    length = np.maximum(np.linalg.norm(n, axis=1), 1e-3)[:, None]
    unit = n / length
    off = np.einsum("ti,ti->t", d, unit)
    # ∂(d·n/‖n‖) = (d − n̂ (d·n̂))/‖n‖ · ∂n + n̂ · ∂d
    lean = (d - unit * off[:, None]) / length
    rate = np.zeros((len(u), size))
    rate[:, :2] = np.einsum("tik,ti->tk", du, np.cross(v, lean))
    rate[:, 2:4] = np.einsum("tik,ti->tk", dv, np.cross(lean, u))
    rate[:, 4] = np.einsum("ti,ti->t", dv_offset, np.cross(lean, u)) + np.einsum("ti,ti->t", unit, dd)
    return [
        ((np.einsum("ti,ti->t", u, v) - cosine) / ALIGNED_RAD, aligned / ALIGNED_RAD),
        (off / RATE_RAD_S, rate / RATE_RAD_S),
    ]


def _huber(residual: Array, jacobian: Array) -> tuple[Array, Array]:
    """Half the sum of squares of the result is Huber's loss, and its Gauss-Newton step follows."""
    size = np.abs(residual)
    far = size > _HUBER
    if not far.any():
        return residual, jacobian
    safe = np.maximum(size, _HUBER)
    tame = np.where(far, np.sign(residual) * np.sqrt(_HUBER * (2.0 * safe - _HUBER)), residual)
    slope = np.where(far, _HUBER / np.maximum(np.abs(tame), 1e-12), 1.0)
    return tame, jacobian * slope[:, None]
