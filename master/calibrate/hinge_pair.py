"""All about a hinge from two units that nobody has aligned: its axes with signs, its centre, a zero angle."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from common.quaternion import heading_turn, to_matrix
from master.calibrate.gauss_newton import tangents
from master.calibrate.hinge import Hinge as FoundHinge
from master.calibrate.hinge import PoorMotionError, check, find_hinge
from master.calibrate.joint_fit import JointFit, fit_joint
from master.calibrate.oriented import moving, orient, rows_moving
from master.calibrate.recording import NodeRecording
from master.fuse.hinge_angle import Hinge

_LEAST_SAMPLES = 60
_WORST_SIGN_RIVAL = 1.1


@dataclass(frozen=True, slots=True)
class HingePair:
    """A hinge between two units."""

    found: FoundHinge
    """Axes from the rates alone (paper C), signs made consistent."""
    fit: JointFit
    """Axes, heading offset and joint centre from rates, accelerations and inclinations together."""
    hinge: Hinge
    """What the fused angle needs. Angle 0 is the pose at the beginning."""


def find_hinge_pair(one: NodeRecording, two: NodeRecording) -> HingePair:
    """Axes by Gauss-Newton over the rates; then their relative sign, which rates alone leave open.

    The sign, the joint's centre and the zero come from what the accelerometers add (`joint_fit.py`).
    Raises PoorMotionError, saying what to do, where the motion does not tell.
    """
    readings = {"unit 1": _named(one, "unit 1"), "unit 2": _named(two, "unit 2")}
    suit = orient(readings, list(readings))
    found = find_hinge(suit.gyr_rad_s[0], suit.gyr_rad_s[1], suit.rate_hz)
    check(found, "the joint")
    first, second = found.axis1, found.axis2
    begin = slice(0, max(1, round(0.2 * suit.rate_hz)))
    (parent, child), spacing_s = moving(suit, begin)
    rows = rows_moving(parent, child)
    if len(rows) < _LEAST_SAMPLES:
        raise PoorMotionError("the joint hardly moved: bend it for 20 s while the whole limb moves about")
    # any level axis: only that it is one counts
    fit = fit_joint(
        parent.some(rows),
        child.some(rows),
        [np.array([0.0, 1.0, 0.0])],
        spacing_s,
        near=[(first, second), (first, -second)],
    )
    assert fit.axes is not None
    axis1, axis2 = fit.axes
    first = math.copysign(1.0, float(first @ axis1)) * first
    second = math.copysign(1.0, float(second @ axis2)) * second
    turn = to_matrix(heading_turn(fit.offset_rad))
    zero1 = tangents(axis1)[:, 0]
    zero2 = (turn @ child.r_stance).T @ (parent.r_stance @ zero1)
    zero2 -= axis2 * (zero2 @ axis2)
    hinge = Hinge(first, second, zero1, zero2, fit.levers_m[0], fit.levers_m[1])
    signed = FoundHinge(
        first, second, found.sigma1_rad, found.sigma2_rad, found.condition, found.misfit_rad_s,
        found.bending_rad_s, found.rival,
    )  # fmt: skip
    return HingePair(signed, fit, hinge)


def _named(unit: NodeRecording, name: str) -> NodeRecording:
    return NodeRecording(name, unit.rate_hz, unit.acc_m_s2, unit.gyr_rad_s)
