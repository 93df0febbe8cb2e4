"""What two neighbouring units share across their joint, and what that tells: axes, heading offset, levers.

Each unit has its orientation from gyro and accelerometer alone, so its inclination is right and its heading
is its own. Between two neighbours, first unit on the parent and second on the child, are unknown:

    j1, j2   the joint's axes, in the sensors' frames: of a hinge one and the same line; of a joint of two
             axes the parent's fixed one and the child's fixed one
    δ        the heading that turns the child's own earth frame into the parent's
    r1, r2   the way from the joint's centre to each sensor, in its frame

All at once they are what comes nearest, by Gauss-Newton from several starts, to

    R1 j1 = R2' j2                          a hinge (R2' = Rz(δ) R2)
    (R1 j1) · (R2' j2) = a1 · a2            two axes, a1 and a2 as in the table
    ω1 − ω2' ∥ R1 j1                        a hinge (Seel et al. 2012, in vector form)
    (ω1 − ω2') · (R1 j1 × R2' j2) = 0       two axes (Laidig, Müller and Seel 2017)
    p̈1 = p̈2', p̈ = R (a − ω̇ × r − ω × (ω × r))   every joint: its centre moves but once (Kok et al. 2014)

where rates ω and accelerations p̈ are in the earth frames, low-passed there so that what skin and muscle
add under the sensor counts little. The stance, in which all segments stand as in the zero pose, says how far
each axis is from the vertical.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from common.quaternion import Array, heading_turn, rotate, to_matrix
from master.calibrate.gauss_newton import along_sphere, gauss_newton, half_sphere, tangents

ALIGNED_RAD = math.radians(6.0)
"""How far soft tissue and anatomy turn a segment's axis from the ideal joint's."""
RATE_RAD_S = 0.3
ACCELERATION_M_S2 = 0.6
"""The same for rates and for the joint centre's acceleration."""
STANCE_RAD = math.radians(8.0)
"""How far an axis in the stance is from where the zero pose has it."""
_STANCE_SHARE = 0.25
"""The stance counts as much as this share of all samples."""
LEVER_M = 0.3
_HUBER = 2.0
"""Residuals beyond so many standard deviations count by their size, not its square."""
_INDEPENDENT_S = 0.2
"""Samples nearer than that to each other say the same."""
_HEADINGS, _OFFSETS = 4, 8
"""Starts: headings of the zero pose over half a turn, and offsets over a whole one."""
_DIRECTIONS = 8
_SURE_RAD, _SURE_RIVAL = math.radians(10.0), 3.0
"""An offset known so well from the accelerations alone is where the axes' search starts."""
_COARSE, _MOST = 250, 1500
_KEPT = 4
_ALIKE_RAD = math.radians(20.0)


Rows = NDArray[np.intp]


@dataclass(frozen=True, slots=True)
class Moving:
    """One unit over the moving part of a recording, (K, ...) samples, and in the stance."""

    r: Array
    """(K, 3, 3) rotation matrices, own earth frame from sensor."""
    rate: Array
    """(K, 3) rad/s, own earth frame, low-passed."""
    acc: Array
    """(K, 3) m/s², specific force in the own earth frame, low-passed."""
    lever: Array
    """(K, 3, 3): times r, the acceleration of the sensor against a point it is r away from, earth frame."""
    r_stance: Array
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


@dataclass(frozen=True, slots=True)
class JointFit:
    """The best answer and how well the data determine it."""

    axes: tuple[Array, Array] | None
    """In the parent's and in the child's sensor frame; their common sign is arbitrary."""
    offset_rad: float
    """δ."""
    levers_m: Array
    """(2, 3): from the joint's centre to each sensor, in its frame."""
    axis_sigma_rad: tuple[float, float]
    offset_sigma_rad: float
    rival: float
    """Cost of the best answer with quite another δ, in units of this one's."""
    axis_rival: float
    """Cost of the best answer with quite other axes, in units of this one's."""
    misfit: dict[str, float]
    """RMS of each kind of residual: `aligned` rad, `rate` rad/s, `acceleration` m/s²."""


def fit_joint(
    parent: Moving,
    child: Moving,
    zero_axes: Sequence[Array] | None,
    spacing_s: float,
    near: Sequence[Axes] | None = None,
) -> JointFit:
    """The unknowns of one joint.

    `zero_axes` are its axes in the zero pose (3,), body frame: one for a hinge, two for a joint of two, None
    for a ball joint. `spacing_s` is the time between samples. Where there was no stance, `near` are a hinge's
    axes to start from besides others, and `zero_axes` only says that it is one.
    """
    count = len(parent.r)
    few, many = (np.arange(0, count, max(1, -(-count // most))) for most in (_COARSE, _MOST))
    offsets = np.arange(_OFFSETS) * 2.0 * math.pi / _OFFSETS
    if zero_axes is not None:
        ball = fit_joint(parent, child, None, spacing_s)
        if ball.offset_sigma_rad < _SURE_RAD and ball.rival > _SURE_RIVAL:
            offsets = np.array([ball.offset_rad, ball.offset_rad + math.pi])
    stood = near is None
    if zero_axes is None:
        starts = [Unknowns(None, float(offset), np.zeros(6)) for offset in offsets]
    elif near is None:
        starts = _starts_of_stance(parent, child, zero_axes, offsets)
    else:
        starts = [Unknowns(axes, float(offset), np.zeros(6)) for axes in near for offset in offsets]
        starts += _starts_anywhere(parent, child, offsets)
    coarse = _Problem(parent.some(few), child.some(few), zero_axes, stood)
    tried = sorted(
        (coarse.descend(start, most_steps=12) for start in starts),
        key=lambda m: m[1],
    )
    kept: list[Unknowns] = []
    for unknowns, _, _ in tried:
        if not any(_same_offset(unknowns, k) and _same_axes(unknowns, k) for k in kept):
            kept.append(unknowns)
    fine = _Problem(parent.some(many), child.some(many), zero_axes, stood)
    refined = sorted((fine.descend(start, most_steps=30) for start in kept[:_KEPT]), key=lambda m: m[1])
    best, cost, normal = refined[0]
    rivals = [c for u, c, _ in refined[1:] if not _same_offset(u, best)]
    axis_rivals = [c for u, c, _ in refined[1:] if not _same_axes(u, best)]
    independent = max(1.0, _INDEPENDENT_S / (spacing_s * max(1, many[1] - many[0] if len(many) > 1 else 1)))
    # residuals are in units of what they may be: data that fit better count as no better than half of it
    scale = max(0.25, 2.0 * cost / fine.rows)
    covariance = scale * independent * np.linalg.pinv(normal, rcond=1e-12).astype(np.float64)
    axes = 4 if zero_axes is not None else 0
    return JointFit(
        best.axes,
        _wrap(best.offset_rad),
        best.levers_m.reshape(2, 3),
        (_worst(covariance[:2, :2]), _worst(covariance[2:4, 2:4])) if axes else (math.pi, math.pi),
        min(math.pi, math.sqrt(covariance[axes, axes])),
        min(rivals, default=math.inf) / max(cost, 1e-12),
        min(axis_rivals, default=math.inf) / max(cost, 1e-12),
        fine.misfit(best),
    )


def _same_offset(one: Unknowns, other: Unknowns) -> bool:
    return abs(_wrap(one.offset_rad - other.offset_rad)) < _ALIKE_RAD


def _same_axes(one: Unknowns, other: Unknowns) -> bool:
    """Up to their signs, which joints leave open."""
    if one.axes is None or other.axes is None:
        return True
    return all(abs(float(a @ b)) > math.cos(_ALIKE_RAD) for a, b in zip(one.axes, other.axes, strict=True))


def _starts_of_stance(
    parent: Moving, child: Moving, zero_axes: Sequence[Array], offsets: Array
) -> list[Unknowns]:
    starts = []
    for heading in np.arange(_HEADINGS) * math.pi / _HEADINGS:
        for offset in offsets:
            # R_stance j = Rz(heading) a, in the parent's earth frame
            axis1 = parent.r_stance.T @ rotate(heading_turn(heading), zero_axes[0])
            axis2 = child.r_stance.T @ rotate(heading_turn(heading - offset), zero_axes[-1])
            starts.append(Unknowns((axis1, axis2), float(offset), np.zeros(6)))
    return starts


def _starts_anywhere(parent: Moving, child: Moving, offsets: Array) -> list[Unknowns]:
    """Of a hinge: at every instant, so also in the reference pose, both units have its axis the same way."""
    starts = []
    for axis in half_sphere(_DIRECTIONS):
        there = parent.r_stance @ axis
        for offset in offsets:
            axis2 = child.r_stance.T @ rotate(heading_turn(-offset), there)
            starts.append(Unknowns((axis, axis2), float(offset), np.zeros(6)))
    return starts


class _Problem:
    """Residuals and Jacobian of one joint over some samples."""

    def __init__(self, parent: Moving, child: Moving, zero_axes: Sequence[Array] | None, stood: bool) -> None:
        self._1, self._2, self._zero_axes, self._stood = parent, child, zero_axes, stood
        self.rows = 0

    def descend(self, start: Unknowns, most_steps: int) -> tuple[Unknowns, float, Array]:
        minimum = gauss_newton(self.linearise, _step, start, most_steps=most_steps, tolerance=1e-6)
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
        stance, slope = self._stance(unknowns.axes, jacobian.shape[1])
        return np.concatenate([residual, stance]), np.concatenate([jacobian, slope])

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

    def _stance(self, axes: tuple[Array, Array], size: int) -> tuple[Array, Array]:
        """Each axis is as steep in the stance as in the zero pose; a level one has either sign."""
        assert self._zero_axes is not None
        # it speaks once, beside samples of which many say the same
        weight = math.sqrt(max(1.0, len(self._1.r) * _STANCE_SHARE)) / STANCE_RAD
        residual, jacobian = np.zeros(2), np.zeros((2, size))
        stances = (self._1.r_stance, self._2.r_stance)
        zero = (self._zero_axes[0], self._zero_axes[-1])
        for i in range(2):
            residual[i] = weight * (stances[i] @ axes[i] - zero[i])[2]
            jacobian[i, 2 * i : 2 * i + 2] = weight * (stances[i] @ tangents(axes[i]))[2]
        return residual, jacobian


def _step(unknowns: Unknowns, x: Array) -> Unknowns:
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


def _worst(covariance: Array) -> float:
    return min(math.pi, math.sqrt(max(0.0, float(np.linalg.eigvalsh(covariance)[-1]))))


def _wrap(angle_rad: float) -> float:
    return math.remainder(angle_rad, 2.0 * math.pi)
