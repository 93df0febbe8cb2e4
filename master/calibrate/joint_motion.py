"""One joint's part in the alignment: whether its motion told anything, and what to do where it did not."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from common.quaternion import Array
from common.skeleton import Skeleton
from master.calibrate.hinge import check_rates
from master.calibrate.joint_fit import JointFit, fit_joint
from master.calibrate.joint_residuals import Moving
from master.calibrate.oriented import rows_moving

_WORST_AXIS_RAD = math.radians(10.0)
_WORST_OFFSET_RAD = math.radians(8.0)
_WORST_RIVAL = 1.15
_LEAST_SAMPLES = 60


@dataclass(frozen=True, slots=True)
class JointFinding:
    """What the motion told about one joint."""

    segment: str
    """The child's name."""
    parent: str
    kind: str
    """`hinge`, `two axes` or `ball`."""
    fit: JointFit | None
    """None: there was nothing to fit."""
    refusal: str | None
    """Why its heading offset is not used, and what to do; None where it is."""
    axes_known: bool
    """Whether its axes are used."""
    flexion_deg: tuple[float, float] | None = None
    """5th and 95th percentile of its first angle over the motion, where its axes are used."""


def zero_axes(skeleton: Skeleton, segment: int) -> list[Array] | None:
    """The axes that constrain a joint, in the zero pose: one of a hinge, two of two axes, None of a ball."""
    entry = skeleton.segments[segment]
    moved = [
        np.asarray(a, dtype=np.float64) for a, turns in zip(entry.axes, entry.human, strict=True) if turns
    ]
    return moved if len(moved) in (1, 2) else None


def joint_motion(skeleton: Skeleton, i: int, parent: Moving, child: Moving, spacing_s: float) -> JointFinding:
    """Fit the joint of segment `i`, and judge whether its heading offset and its axes may be used."""
    entry = skeleton.segments[i]
    axes = zero_axes(skeleton, i)
    kind = "ball" if axes is None else ("hinge", "two axes")[len(axes) - 1]
    rows = rows_moving(parent, child)
    ask = _ask(kind, entry.name, entry.parent)
    if len(rows) < _LEAST_SAMPLES:
        return JointFinding(entry.name, entry.parent, kind, None, f"it hardly moved; {ask}", False)
    fit = fit_joint(parent.some(rows), child.some(rows), axes, spacing_s)
    rates = None
    if kind == "hinge":
        fit, rates = check_rates(fit, parent.some(rows), child.some(rows), spacing_s)
    refusal = None
    if rates is not None and rates.contradicts:
        refusal = rates.advice
    elif 0.5 * fit.steady.offset_change_rad > _WORST_OFFSET_RAD:
        refusal = (
            f"{_percent(fit.steady.change_share)} of the way through the motion the heading between both "
            f"changes by {math.degrees(fit.steady.offset_change_rad):.0f}°: {entry.name} or {entry.parent} "
            "slipped, or its gyroscope is not to be trusted. Fix both firmly, and record again"
        )
    elif fit.offset_sigma_rad > _WORST_OFFSET_RAD:
        refusal = f"heading only known to ± {math.degrees(fit.offset_sigma_rad):.0f}°; {ask}"
    elif fit.rival < _WORST_RIVAL:
        refusal = f"another heading explains the motion as well; {ask}"
    known = (
        axes is not None
        and refusal is None
        and max(fit.axis_sigma_rad) < _WORST_AXIS_RAD
        and fit.axis_rival > _WORST_RIVAL
    )
    return JointFinding(entry.name, entry.parent, kind, fit, refusal, known)


def _percent(share: float) -> str:
    return f"{100.0 * share:.0f} %"


def _ask(kind: str, segment: str, parent: str) -> str:
    if kind == "ball":
        return f"walk some steps, bow briskly and turn, and move {segment} against {parent} meanwhile"
    return f"bend {segment} against {parent} ten times while the whole limb moves about"
