"""A hinge's axes from the rates alone beside those of the full answer: two ways that should agree.

The rates are those that neighbours share, low-passed in the earth frame (`oriented.py`): as the sensors read
them, skin that shakes under a thigh turns paper C's answer by 80°. What is left apart widens the stated
uncertainty, and beyond a limit it refuses the answer.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from common.quaternion import Array
from master.calibrate.evidence import Evidence, at_most, not_judged
from master.calibrate.hinge import PoorMotionError, check, find_hinge
from master.calibrate.joint_fit import JointFit
from master.calibrate.joint_residuals import Moving

WORST_APART_RAD = math.radians(30.0)
"""A real person's thigh, the worst segment for skin, is 13 to 28° apart; a simulated one 0.2°."""
_SHARE = 1.0 / 3.0
"""Of what both ways are apart, one standard deviation of either."""


def check_rates(fit: JointFit, parent: Moving, child: Moving, spacing_s: float) -> tuple[JointFit, Evidence]:
    """The answer with its uncertainty widened by what the rates alone say, and the comparison itself."""
    compared = "the hinge's axes against the rates alone"
    assert fit.axes is not None
    try:
        found = find_hinge(_in_sensor(parent), _in_sensor(child), 1.0 / spacing_s)
        check(found, "the joint")
    except PoorMotionError as error:
        return fit, not_judged(compared, f"the rates alone do not tell: {error}")
    apart = [_apart(a, b) for a, b in zip((found.axis1, found.axis2), fit.axes, strict=True)]
    sigma = (
        max(fit.axis_sigma_rad[0], _SHARE * apart[0]),
        max(fit.axis_sigma_rad[1], _SHARE * apart[1]),
    )
    evidence = at_most(
        compared,
        math.degrees(max(apart)),
        math.degrees(WORST_APART_RAD),
        "°",
        advice=f"its axes by all readings are {math.degrees(max(apart)):.0f}° from those by the rates alone: "
        "one of the two units is loose, clipped or on another segment. Fix both, and record ten slow bends "
        "through the whole range",
    )
    return replace(fit, axis_sigma_rad=sigma), evidence


def _in_sensor(unit: Moving) -> Array:
    """The shared rates (K, 3) in the sensor's own frame."""
    out: Array = np.einsum("kji,kj->ki", unit.r, unit.rate)
    return out


def _apart(one: Array, other: Array) -> float:
    return math.acos(min(1.0, abs(float(one @ other))))
