"""A hinge from two units that are not aligned: its axes with signs, its centre, a zero angle.

The rates alone (paper C) leave the axes' relative sign open, and skin that shakes under a sensor can turn
their answer far away: on a walking person's thigh by 80°, where the answer from rates, inclinations and
accelerations together stays within 2° of the one that knows the zero pose. So the latter is the answer, the
former stands beside it. Low-passed, the rates alone must not contradict it: what both are apart is in the
stated uncertainty, and beyond a limit nothing is said.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from common.quaternion import heading_turn, to_matrix
from master.calibrate.clock_lag import WORST_LAG_S, joint_lag
from master.calibrate.evidence import CrossCheck, first_contradiction
from master.calibrate.gauss_newton import tangents
from master.calibrate.hinge import HingeAxes, PoorMotionError, again, check_moved, check_rates, find_hinge
from master.calibrate.joint_fit import JointFit, fit_joint
from master.calibrate.oriented import bridged, moving, orient, rows_moving
from master.calibrate.recording import NodeRecording
from master.calibrate.unit_evidence import unit_evidence
from master.orientation.hinge_angle import Hinge

_LEAST_SAMPLES = 60
_WORST_SIGMA_RAD = math.radians(10.0)
_WORST_RIVAL = 1.15


@dataclass(frozen=True, slots=True)
class HingePair:
    """A hinge between two units."""

    found: HingeAxes
    """Axes from the rates alone (paper C), signs as the answer's."""
    fit: JointFit
    """The answer: axes, heading offset and joint centre from all readings together."""
    rates: CrossCheck
    """The answer's axes against the rates alone, low-passed as neighbours share them."""
    hinge: Hinge
    """What the fused angle needs of it. Angle 0 is the pose at the beginning."""


def find_hinge_pair(one: NodeRecording, two: NodeRecording) -> HingePair:
    """Axes from the rates alone, then the full answer (`joint_fit.py`), from these and many other starts.

    Raises PoorMotionError, saying what to do, where the motion does not tell.
    """
    readings = {"unit 1": _named(one, "unit 1"), "unit 2": _named(two, "unit 2")}
    for name, unit in readings.items():
        wrong = first_contradiction(unit_evidence(unit))
        if wrong is not None:
            raise PoorMotionError(f"{name}: {wrong.advice}")
    suit = orient(readings, list(readings))
    found = find_hinge(suit.gyr_rad_s[0], suit.gyr_rad_s[1], suit.rate_hz)
    check_moved(found, "the joint")
    first, second = found.axis1, found.axis2
    begin = slice(0, max(1, round(0.2 * suit.rate_hz)))
    (parent, child), spacing_s = moving(suit, begin)
    rows = rows_moving(parent, child)
    if len(rows) < _LEAST_SAMPLES:
        raise PoorMotionError("the joint hardly moved: bend it for 20 s while the whole limb moves about")
    fit = fit_joint(
        parent.some(rows),
        child.some(rows),
        [np.array([0.0, 1.0, 0.0])],
        spacing_s,
        near=[(first, second), (first, -second)],
    )
    assert fit.axes is not None
    fit, rates = check_rates(fit, parent.some(rows), child.some(rows), spacing_s)
    lag = joint_lag(parent, child, spacing_s)
    if rates.contradicts:
        raise PoorMotionError(f"the joint: {rates.advice}")
    if lag is not None and abs(lag.seconds) > WORST_LAG_S:
        raise PoorMotionError(
            f"unit 2 comes {1e3 * lag.seconds:.0f} ms after unit 1; look at their clocks, and record again"
        )
    assert fit.axes is not None
    sigma = max(fit.axis_sigma_rad)
    if sigma > _WORST_SIGMA_RAD:
        raise PoorMotionError(f"its axis is only known to ± {math.degrees(sigma):.0f}°; {again('the joint')}")
    if min(fit.rival, fit.axis_rival) < _WORST_RIVAL:
        raise PoorMotionError(f"a quite different axis explains the motion as well; {again('the joint')}")
    axis1, axis2 = fit.axes
    first = math.copysign(1.0, float(first @ axis1)) * first
    second = math.copysign(1.0, float(second @ axis2)) * second
    turn = to_matrix(heading_turn(fit.offset_rad))
    zero1 = tangents(axis1)[:, 0]
    zero2 = (turn @ child.r_zero_pose).T @ (parent.r_zero_pose @ zero1)
    zero2 -= axis2 * (zero2 @ axis2)
    hinge = Hinge(axis1, axis2, zero1, zero2, fit.levers_m[0], fit.levers_m[1])
    signed = HingeAxes(
        first, second, found.sigma1_rad, found.sigma2_rad, found.condition, found.misfit_rad_s,
        found.bending_rad_s, found.rival,
    )  # fmt: skip
    return HingePair(signed, fit, rates, hinge)


def _named(unit: NodeRecording, name: str) -> NodeRecording:
    return NodeRecording(name, unit.rate_hz, unit.acc_m_s2, unit.gyr_rad_s)


def without_gaps(unit: NodeRecording) -> NodeRecording:
    """The unit with short gaps bridged, as the axes' search sees it."""
    return NodeRecording(
        unit.name,
        unit.rate_hz,
        bridged(unit.acc_m_s2, unit.name, unit.rate_hz),
        bridged(unit.gyr_rad_s, unit.name, unit.rate_hz),
    )
