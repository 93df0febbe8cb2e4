"""A hinge's axes that the rates alone contradict are refused; a smaller difference is in the uncertainty."""

import math
from dataclasses import replace

import numpy as np
import pytest

from common.skeleton import load_skeleton
from master.calibrate.gauss_newton import along_sphere
from master.calibrate.hinge import check_rates
from master.calibrate.joint_fit import JointFit, fit_joint
from master.calibrate.joint_motion import zero_axes
from master.calibrate.joint_residuals import Moving
from master.calibrate.oriented import moving, orient, rows_moving
from tests.master.calibrate.worn import wear

LEGS = load_skeleton("lower_limb")
Knee = tuple[JointFit, Moving, Moving, float]


@pytest.fixture(scope="module")
def knee() -> Knee:
    worn = wear("lower_limb", 6)
    suit = orient(worn.nodes, ["left_thigh", "left_shank"])
    (parent, child), spacing_s = moving(suit, slice(50, 250))
    rows = rows_moving(parent, child)
    axes = zero_axes(LEGS, LEGS.segment_names.index("left_shank"))
    parent, child = parent.some(rows), child.some(rows)
    return fit_joint(parent, child, axes, spacing_s), parent, child, spacing_s


@pytest.mark.parametrize(("deg", "verdict"), [(0.0, "agrees"), (20.0, "agrees"), (35.0, "contradicts")])
def test_what_both_ways_are_apart_counts(knee: Knee, deg: float, verdict: str) -> None:
    fit, parent, child, spacing_s = knee
    assert fit.axes is not None
    turned = along_sphere(fit.axes[0], np.array([math.radians(deg), 0.0]))
    wider, evidence = check_rates(replace(fit, axes=(turned, fit.axes[1])), parent, child, spacing_s)
    assert evidence.verdict == verdict
    assert evidence.figure == pytest.approx(deg, abs=1.0)
    assert math.degrees(wider.axis_sigma_rad[0]) >= deg / 3.0 - 0.5


def test_rates_that_do_not_tell_are_not_judged(knee: Knee) -> None:
    fit, parent, _, spacing_s = knee
    assert check_rates(fit, parent, parent, spacing_s)[1].verdict == "not judged"
