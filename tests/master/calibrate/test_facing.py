"""Which way the person faced: limbs turned in or out, and axes whose sign the motion left open."""

import math

import pytest

from master.calibrate.facing import Axis, facing_of

KNOWN_RAD = 0.02


def axis(facing_deg: float, told: bool = True) -> Axis:
    return Axis(0, math.radians(facing_deg), KNOWN_RAD, told)


def test_limbs_turned_out_alike_face_ahead_together() -> None:
    found = facing_of({"left_forearm": [axis(40.0)], "right_forearm": [axis(-20.0)]})
    assert found is not None
    assert math.degrees(found[0]) == pytest.approx(10.0)
    assert math.degrees(found[1]) == pytest.approx(8.0)


def test_a_limb_alone_is_known_less_well() -> None:
    found = facing_of({"left_forearm": [axis(30.0)]})
    assert found is not None
    assert math.degrees(found[1]) == pytest.approx(15.0)


def test_pairs_that_disagree_are_known_less_well() -> None:
    pairs = {
        f"{side}_{part}": [axis(at)]
        for part, at in (("thigh", -20.0), ("shank", 20.0))
        for side in ("left", "right")
    }
    found = facing_of(pairs)
    assert found is not None
    assert math.degrees(found[0]) == pytest.approx(0.0, abs=1e-9)
    assert math.degrees(found[1]) == pytest.approx(20.0 / math.sqrt(2.0))


@pytest.mark.parametrize("open_deg", [-15.0, 165.0, 195.0, -165.0 - 360.0])
def test_a_sign_left_open_is_the_one_that_agrees_with_the_others(open_deg: float) -> None:
    open_axis = axis(open_deg, told=False)
    found = facing_of({"left_forearm": [axis(5.0)], "right_forearm": [open_axis]})
    assert found is not None
    assert math.cos(open_axis.facing_rad - math.radians(5.0)) > 0.9
    assert abs(math.degrees(found[0])) < 12.0


def test_where_every_sign_is_open_nothing_is_said() -> None:
    assert (
        facing_of({"left_forearm": [axis(0.0, told=False)], "right_forearm": [axis(3.0, told=False)]}) is None
    )
    assert facing_of({}) is None
