"""At which uncertainty a joint's motion is believed; what its fit finds is another test's."""

import math
from typing import Any

import numpy as np
import pytest

from common.skeleton import load_skeleton
from master.calibrate import joint_motion as module
from master.calibrate.joint_fit import JointFit
from master.calibrate.joint_motion import JointFinding, joint_motion
from master.calibrate.joint_residuals import Moving
from master.calibrate.steadiness import Steadiness

ARMS = load_skeleton("nursing")
Y = np.array([0.0, 1.0, 0.0])
STEADY = Steadiness(0.0, (0.0, 0.0), 0.0, (0.0, 0.0), 0.0)


def judge(monkeypatch: pytest.MonkeyPatch, segment: str, moving: bool = True, **fit: Any) -> JointFinding:
    """What is made of a fit with those properties, and otherwise beyond doubt."""
    good: dict[str, Any] = {
        "axis_sigma_rad": (0.01, 0.01),
        "offset_sigma_rad": 0.01,
        "rival": 9.0,
        "axis_rival": 9.0,
    }
    found = JointFit((Y, Y), 0.0, np.zeros((2, 3)), misfit={}, steady=STEADY, **(good | fit))
    monkeypatch.setattr(module, "fit_joint", lambda *_: found)
    count, turning = 100, 2.0 if moving else 0.0
    unit = Moving(
        np.tile(np.eye(3), (count, 1, 1)),
        np.tile([0.0, turning, 0.0], (count, 1)),
        np.zeros((count, 3)),
        np.zeros((count, 3, 3)),
        np.eye(3),
    )
    still = Moving(unit.r, np.zeros((count, 3)), unit.acc, unit.lever, unit.r_zero_pose)
    return joint_motion(ARMS, ARMS.segment_names.index(segment), still, unit, 0.05)


@pytest.mark.parametrize(("sigma_deg", "used"), [(7.9, True), (8.1, False)])
def test_a_heading_is_used_up_to_eight_degrees(
    monkeypatch: pytest.MonkeyPatch, sigma_deg: float, used: bool
) -> None:
    found = judge(monkeypatch, "left_forearm", offset_sigma_rad=math.radians(sigma_deg))
    assert (found.refusal is None) == used
    assert found.axes_known == used
    if not used:
        assert "heading only known to ± 8°; bend left_forearm against left_upper_arm" in str(found.refusal)


@pytest.mark.parametrize(("rival", "used"), [(1.16, True), (1.14, False)])
def test_another_heading_that_explains_the_motion_as_well_refuses_it(
    monkeypatch: pytest.MonkeyPatch, rival: float, used: bool
) -> None:
    found = judge(monkeypatch, "left_forearm", rival=rival)
    assert (found.refusal is None) == used
    assert used or "another heading explains the motion as well" in str(found.refusal)


@pytest.mark.parametrize(
    ("fit", "known"),
    [
        ({"axis_sigma_rad": (0.01, math.radians(9.9))}, True),
        ({"axis_sigma_rad": (0.01, math.radians(10.1))}, False),
        ({"axis_sigma_rad": (math.radians(10.1), 0.01)}, False),
        ({"axis_rival": 1.16}, True),
        ({"axis_rival": 1.14}, False),
    ],
)
def test_axes_may_be_unsure_where_the_heading_is_not(
    monkeypatch: pytest.MonkeyPatch, fit: dict[str, Any], known: bool
) -> None:
    found = judge(monkeypatch, "left_forearm", **fit)
    assert found.refusal is None
    assert found.axes_known == known


def test_a_ball_joint_has_no_axes(monkeypatch: pytest.MonkeyPatch) -> None:
    found = judge(monkeypatch, "left_upper_arm")
    assert (found.kind, found.refusal, found.axes_known) == ("ball", None, False)


def test_what_hardly_moved_is_not_even_fitted(monkeypatch: pytest.MonkeyPatch) -> None:
    found = judge(monkeypatch, "left_forearm", moving=False)
    assert found.fit is None
    assert str(found.refusal).startswith("it hardly moved; bend left_forearm")
