"""The nearest rotation within limits against a search of the whole box, and what the closed form rests on."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.quaternion import Array, from_axis_angle, multiply
from common.reach.nearest import (
    Box,
    Triple,
    angle_range,
    box,
    decompositions,
    nearest_angles,
    scalar_product,
    tensor,
)

BOXES_DEG = {
    "shoulder": ((-45.0, 150.0), (-15.0, 80.0), (-80.0, 80.0)),
    "hip": ((-30.0, 120.0), (-25.0, 45.0), (-45.0, 40.0)),
    "beyond the pole": ((-170.0, 220.0), (20.0, 170.0), (-80.0, 80.0)),
    "elbow": ((0.0, 140.0), (0.0, 0.0), (-85.0, 85.0)),
    "neck": ((-70.0, 70.0), (-40.0, 50.0), (0.0, 0.0)),
    "lean": ((0.0, 0.0), (-10.0, 60.0), (-20.0, 20.0)),
    "wrist": ((-60.0, 60.0), (0.0, 0.0), (0.0, 0.0)),
    "second alone": ((0.0, 0.0), (-30.0, 90.0), (0.0, 0.0)),
    "third alone": ((0.0, 0.0), (0.0, 0.0), (-30.0, 90.0)),
}
angles = st.tuples(*[st.floats(-math.pi, math.pi)] * 3)
BOXES = pytest.mark.parametrize("ends_deg", BOXES_DEG.values(), ids=BOXES_DEG)


def boxed(ends_deg: tuple[tuple[float, float], ...]) -> Box:
    return box(*(angle_range(*np.radians(ends)) for ends in ends_deg))


def amid(ends_deg: tuple[tuple[float, float], ...]) -> Triple:
    a, b, c = (math.radians(0.5 * (low + high)) for low, high in ends_deg)
    return a, b, c


def rotation(angles_rad: Array) -> Array:
    """Quaternions (..., 4) of qx(a) qy(b) qz(c) for angles (..., 3)."""
    x, y, z = (from_axis_angle(np.eye(3)[k], angles_rad[..., k]) for k in range(3))
    return multiply(multiply(x, y), z)


@given(angles, angles)
def test_eight_numbers_say_the_scalar_product(these: Triple, wanted: Triple) -> None:
    q = rotation(np.array(wanted))
    assert scalar_product(tensor(*q), these) == pytest.approx(rotation(np.array(these)) @ q, abs=1e-12)


@given(angles)
def test_both_decompositions_make_the_rotation(wanted: Triple) -> None:
    q = rotation(np.array(wanted))
    for found in decompositions(tensor(*q)):
        assert abs(rotation(np.array(found)) @ q) == pytest.approx(1.0, abs=1e-12)


@BOXES
def test_no_other_angles_within_the_limits_are_nearer(ends_deg: tuple[tuple[float, float], ...]) -> None:
    rng = np.random.default_rng(1)
    low, high = np.radians(ends_deg).T
    grid = np.stack(
        np.meshgrid(*(np.linspace(a, b, 25 if b > a else 1) for a, b in zip(low, high, strict=True))), -1
    ).reshape(-1, 3)
    searched = rotation(grid)
    for _ in range(300):
        q = rng.normal(size=4)
        q /= np.linalg.norm(q)
        found = nearest_angles(tensor(*q), boxed(ends_deg), amid(ends_deg))
        assert np.all((low <= found.angles) & (found.angles <= high))
        assert abs(rotation(np.array(found.angles)) @ q) == pytest.approx(found.cosine, abs=1e-9)
        assert found.cosine >= np.abs(searched @ q).max() - 1e-12


@BOXES
def test_what_can_be_reached_is_reached(ends_deg: tuple[tuple[float, float], ...]) -> None:
    rng = np.random.default_rng(2)
    low, high = np.radians(ends_deg).T
    for _ in range(200):
        inside = rng.uniform(low, high)
        found = nearest_angles(tensor(*rotation(inside)), boxed(ends_deg), tuple(inside))
        np.testing.assert_allclose(found.angles, inside, atol=1e-6)


def test_of_two_decompositions_the_nearer_one_is_kept() -> None:
    within = boxed(((-190.0, 190.0), (-20.0, 170.0), (-190.0, 190.0)))
    here = np.radians([20.0, 100.0, -30.0])
    other = np.radians([-160.0, 80.0, 150.0])
    t = tensor(*rotation(here))
    np.testing.assert_allclose(nearest_angles(t, within, tuple(here + 0.1)).angles, here, atol=1e-9)
    np.testing.assert_allclose(nearest_angles(t, within, tuple(other - 0.1)).angles, other, atol=1e-9)


def test_an_angle_beyond_half_a_turn_is_unwrapped() -> None:
    within = boxed(((-45.0, 200.0), (-15.0, 80.0), (-80.0, 80.0)))
    t = tensor(*rotation(np.radians([185.0, 10.0, 5.0])))
    np.testing.assert_allclose(
        np.degrees(nearest_angles(t, within, amid(((-45.0, 200.0), (-15.0, 80.0), (-80.0, 80.0)))).angles),
        [185.0, 10.0, 5.0],
        atol=1e-9,
    )
    shorter = boxed(BOXES_DEG["shoulder"])
    t = tensor(*rotation(np.radians([185.0, 0.0, 0.0])))
    assert np.degrees(nearest_angles(t, shorter, (0.0, 0.0, 0.0)).angles[0]) == pytest.approx(150.0)
