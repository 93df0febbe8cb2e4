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
add under the sensor counts little. The time in which all segments stand in the zero pose says how far
each axis is from the vertical.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from common.quaternion import Array, heading_turn, rotate
from master.calibrate.gauss_newton import half_sphere
from master.calibrate.joint_residuals import Axes, JointProblem, Moving, Unknowns
from master.calibrate.steadiness import Steadiness, steadiness, worst_sigma

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


@dataclass(frozen=True, slots=True)
class JointFit:
    """The best answer and how well the data determine it, by whichever way of telling is the most careful."""

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
    steady: Steadiness
    """Whether all parts of the recording tell the same."""
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
    for a ball joint. `spacing_s` is the time between samples. Without a zero pose, `near` are a hinge's
    axes to start from besides others, and `zero_axes` only says that it is one.
    """
    count = len(parent.r)
    few, many = (np.arange(0, count, max(1, -(-count // most))) for most in (_COARSE, _MOST))
    stood = near is None
    starts = _starts(parent, child, zero_axes, spacing_s, near)
    coarse = JointProblem(parent.some(few), child.some(few), zero_axes, stood)
    tried = sorted((coarse.descend(start, most_steps=12) for start in starts), key=lambda m: m[1])
    kept: list[Unknowns] = []
    for unknowns, _, _ in tried:
        if not any(_same_offset(unknowns, k) and _same_axes(unknowns, k) for k in kept):
            kept.append(unknowns)
    fine = JointProblem(parent.some(many), child.some(many), zero_axes, stood)
    refined = sorted((fine.descend(start, most_steps=30) for start in kept[:_KEPT]), key=lambda m: m[1])
    best, cost, normal = refined[0]
    rivals = [c for u, c, _ in refined[1:] if not _same_offset(u, best)]
    axis_rivals = [c for u, c, _ in refined[1:] if not _same_axes(u, best)]
    independent = max(1.0, _INDEPENDENT_S / (spacing_s * max(1, many[1] - many[0] if len(many) > 1 else 1)))
    # residuals are in units of what they may be: data that fit better count as no better than half of it
    scale = max(0.25, 2.0 * cost / fine.rows)
    covariance = scale * independent * np.linalg.pinv(normal, rcond=1e-12).astype(np.float64)
    axes = 4 if zero_axes is not None else 0
    formal = (math.pi, math.pi)
    if axes:
        formal = (worst_sigma(covariance[:2, :2]), worst_sigma(covariance[2:4, 2:4]))
    steady = steadiness(fine, best)
    return JointFit(
        best.axes,
        _wrap(best.offset_rad),
        best.levers_m.reshape(2, 3),
        (_true(formal[0], steady, 0), _true(formal[1], steady, 1)),
        # a heading that changed half-way is right for neither half
        max(
            min(math.pi, math.sqrt(covariance[axes, axes])),
            steady.offset_sigma_rad,
            0.5 * steady.offset_change_rad,
        ),
        min(rivals, default=math.inf) / max(cost, 1e-12),
        min(axis_rivals, default=math.inf) / max(cost, 1e-12),
        steady,
        fine.misfit(best),
    )


def _same_offset(one: Unknowns, other: Unknowns) -> bool:
    return abs(_wrap(one.offset_rad - other.offset_rad)) < _ALIKE_RAD


def _same_axes(one: Unknowns, other: Unknowns) -> bool:
    """Up to their signs, which joints leave open."""
    if one.axes is None or other.axes is None:
        return True
    return all(abs(float(a @ b)) > math.cos(_ALIKE_RAD) for a, b in zip(one.axes, other.axes, strict=True))


def _starts(
    parent: Moving,
    child: Moving,
    zero_axes: Sequence[Array] | None,
    spacing_s: float,
    near: Sequence[Axes] | None,
) -> list[Unknowns]:
    """Where the descent begins: many headings, and many axes of a joint that has some."""
    offsets = np.arange(_OFFSETS) * 2.0 * math.pi / _OFFSETS
    if zero_axes is None:
        return [Unknowns(None, float(offset), np.zeros(6)) for offset in offsets]
    ball = fit_joint(parent, child, None, spacing_s)
    if ball.offset_sigma_rad < _SURE_RAD and ball.rival > _SURE_RIVAL:
        offsets = np.array([ball.offset_rad, ball.offset_rad + math.pi])
    if near is None:
        return _starts_of_zero_pose(parent, child, zero_axes, offsets)
    starts = [Unknowns(axes, float(offset), np.zeros(6)) for axes in near for offset in offsets]
    return starts + _starts_anywhere(parent, child, offsets)


def _starts_of_zero_pose(
    parent: Moving, child: Moving, zero_axes: Sequence[Array], offsets: Array
) -> list[Unknowns]:
    starts = []
    for heading in np.arange(_HEADINGS) * math.pi / _HEADINGS:
        for offset in offsets:
            # R_zero_pose j = Rz(heading) a, in the parent's earth frame
            axis1 = parent.r_zero_pose.T @ rotate(heading_turn(heading), zero_axes[0])
            axis2 = child.r_zero_pose.T @ rotate(heading_turn(heading - offset), zero_axes[-1])
            starts.append(Unknowns((axis1, axis2), float(offset), np.zeros(6)))
    return starts


def _starts_anywhere(parent: Moving, child: Moving, offsets: Array) -> list[Unknowns]:
    """Of a hinge: at every instant, so also in the reference pose, both units have its axis the same way."""
    starts = []
    for axis in half_sphere(_DIRECTIONS):
        there = parent.r_zero_pose @ axis
        for offset in offsets:
            axis2 = child.r_zero_pose.T @ rotate(heading_turn(-offset), there)
            starts.append(Unknowns((axis, axis2), float(offset), np.zeros(6)))
    return starts


def _true(formal: float, steady: Steadiness, end: int) -> float:
    """An axis's standard deviation: the least that any of the ways to tell it leaves."""
    return max(formal, steady.axis_sigma_rad[end], 0.5 * steady.axis_change_rad[end])


def _wrap(angle_rad: float) -> float:
    return math.remainder(angle_rad, 2.0 * math.pi)
