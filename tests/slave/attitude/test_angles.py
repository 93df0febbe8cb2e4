"""The angles against rotations; what spins about its axis; the paper's own ψ, θ, φ and Eq. 20 beside them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from common.quaternion import Array, conjugate, rotate
from slave.attitude.angles import (
    azimuth_rad,
    gravity_tool_face_rad,
    inclination_rad,
    magnetic_tool_face_rad,
    orientation,
    true_azimuth_rad,
    up_in_instrument,
    wrapped,
)
from slave.attitude.attitude import NEAR_VERTICAL_RAD, attitude

FIELD: Array = np.array([0.0, 34.5, -36.0])
UP: Array = np.array([0.0, 0.0, 9.8])
turns = st.floats(0.0, math.tau)
quick = settings(max_examples=100, derandomize=True, deadline=None)


def off(a: Array | float, b: Array | float) -> Array:
    """The angle between two angles, the short way."""
    out: Array = np.abs((np.asarray(a) - b + np.pi) % (2.0 * np.pi) - np.pi)
    return out


def random_attitudes(count: int = 2000) -> tuple[Array, Rotation]:
    turn = Rotation.random(count, random_state=7)
    return turn.as_quat(scalar_first=True), turn


def test_angles_of_random_rotations_are_those_of_the_axis_in_the_world() -> None:
    _, turn = random_attitudes()
    up, field = turn.inv().apply(UP), turn.inv().apply(FIELD)
    axis = turn.apply([0.0, 0.0, 1.0])
    assert np.allclose(inclination_rad(up), np.arccos(axis[:, 2]), atol=1e-7)
    assert off(azimuth_rad(up, field), np.arctan2(axis[:, 0], axis[:, 1])).max() < 1e-9
    # the tool-face is the turn about the axis that brings y from the low side to where it is
    low = np.array([0.0, 0.0, -1.0]) + axis[:, 2:] * axis
    y = turn.apply([0.0, 1.0, 0.0])
    sine = np.einsum("ni,ni->n", np.cross(low, y), axis)
    assert off(gravity_tool_face_rad(up), np.arctan2(sine, np.einsum("ni,ni->n", low, y))).max() < 1e-9
    beside = FIELD - (axis @ FIELD)[:, None] * axis
    sine = np.einsum("ni,ni->n", np.cross(beside, y), axis)
    assert off(magnetic_tool_face_rad(field), np.arctan2(sine, np.einsum("ni,ni->n", beside, y))).max() < 1e-9


def test_inclination_and_tool_faces_are_the_papers_formulas() -> None:
    """Eqs. 10, 21 and 22, with G = -up."""
    _, turn = random_attitudes()
    gx, gy, gz = turn.inv().apply(-UP).T
    hx, hy, _ = turn.inv().apply(FIELD).T
    up, field = turn.inv().apply(UP), turn.inv().apply(FIELD)
    assert np.allclose(inclination_rad(up), np.arccos(-gz / np.sqrt(gx**2 + gy**2 + gz**2)), atol=1e-7)
    assert off(gravity_tool_face_rad(up), np.arctan2(gx, gy)).max() < 1e-12
    assert off(magnetic_tool_face_rad(field), np.arctan2(hx, hy)).max() < 1e-12


@quick
@given(st.floats(0.01, math.pi - 0.01), turns, turns)
def test_an_orientation_has_the_angles_it_was_made_of(
    inclination: float, azimuth: float, tool_face: float
) -> None:
    q = orientation(np.asarray(inclination), np.asarray(azimuth), np.asarray(tool_face))
    up, field = rotate(conjugate(q), UP), rotate(conjugate(q), FIELD)
    assert inclination_rad(up) == pytest.approx(inclination, abs=1e-12)
    assert off(azimuth_rad(up, field), azimuth) < 1e-9
    assert off(gravity_tool_face_rad(up), tool_face) < 1e-9
    again = up_in_instrument(inclination_rad(up), gravity_tool_face_rad(up))
    assert np.allclose(again, up / np.linalg.norm(up), atol=1e-12)


@quick
@given(st.floats(0.1, math.pi - 0.1), turns, turns)
def test_spinning_about_its_axis_moves_no_inclination_or_azimuth(
    inclination: float, azimuth: float, spin: float
) -> None:
    still = orientation(np.asarray(inclination), np.asarray(azimuth), np.asarray(0.0))
    spun = orientation(np.asarray(inclination), np.asarray(azimuth), np.asarray(spin))
    for q in (still, spun):
        up, field = rotate(conjugate(q), UP), rotate(conjugate(q), FIELD)
        assert inclination_rad(up) == pytest.approx(inclination, abs=1e-9)
        assert off(azimuth_rad(up, field), azimuth) < 1e-9
    assert (
        off(magnetic_tool_face_rad(field), magnetic_tool_face_rad(rotate(conjugate(still), FIELD)) + spin)
        < 1e-9
    )


def euler_as_printed(up: Array, field: Array) -> tuple[Array, Array, Array]:
    """ψ, θ, φ of Eqs. 3 to 5, taken for azimuth, inclination and tool-face; G = -up.

    Eq. 5 is printed with G_y twice: it is G_x that a turn about y brings in.
    """
    gx, gy, gz = -np.moveaxis(up, -1, 0)
    hx, hy, hz = np.moveaxis(field, -1, 0)
    theta = np.arctan2(-gy, np.hypot(gx, gz))
    phi = np.arctan2(gx, gz)
    below = hx * np.cos(phi) + hy * np.sin(phi) * np.sin(theta) - hz * np.sin(phi) * np.cos(theta)
    return np.arctan2(hy * np.cos(theta) + hz * np.sin(theta), below), theta, phi


def test_the_papers_euler_angles_swing_when_it_spins() -> None:
    """The paper's warning: they are not inclination and azimuth."""
    spin = np.linspace(0.0, math.tau, 361)
    q = orientation(np.full(361, math.radians(60.0)), np.full(361, math.radians(40.0)), spin)
    up, field = rotate(conjugate(q), UP), rotate(conjugate(q), FIELD)
    psi, theta, _ = euler_as_printed(up, field)
    assert math.degrees(np.ptp(np.abs(theta))) > 50.0
    assert math.degrees(off(psi, psi[0]).max()) > 100.0
    assert math.degrees(np.ptp(inclination_rad(up))) < 1e-6
    assert math.degrees(off(azimuth_rad(up, field), math.radians(40.0)).max()) < 1e-6


def test_the_papers_equation_20_is_off_by_tens_of_degrees() -> None:
    """Even where its two arcs are taken in all four quadrants."""
    _, turn = random_attitudes()
    up, field = turn.inv().apply(UP), turn.inv().apply(FIELD)
    gx, gy, _ = -up.T / np.linalg.norm(UP)
    hx, hy, hz = field.T
    ax, ay = np.arcsin(-gx), np.arcsin(-gy)
    above = hy * np.cos(ay) + hz * np.sin(ay)
    below = hx * np.cos(ax) + hy * np.sin(ax) * np.sin(ay) - hz * np.sin(ax) * np.cos(ay)
    printed = np.arctan2(above, below) - np.arctan2(ay, ax)
    assert math.degrees(np.median(off(printed, azimuth_rad(up, field)))) > 20.0


@pytest.mark.parametrize("inclination", [0.0, math.pi])
def test_a_vertical_axis_has_no_azimuth_and_no_gravity_tool_face(inclination: float) -> None:
    up = np.array([0.0, 0.0, 9.8 * math.cos(inclination)])
    field = np.array([10.0, 20.0, -30.0])
    assert inclination_rad(up) == inclination
    assert np.isnan(azimuth_rad(up, field))
    assert np.isnan(gravity_tool_face_rad(up))
    assert magnetic_tool_face_rad(field) == pytest.approx(math.atan2(10.0, 20.0))


def test_a_vertical_field_has_no_azimuth_and_an_axial_one_no_turn() -> None:
    up = np.array([3.0, -4.0, 5.0])
    assert np.isnan(azimuth_rad(up, -7.0 * up))
    assert np.isnan(azimuth_rad(up, np.zeros(3)))
    assert np.isnan(magnetic_tool_face_rad(np.array([0.0, 0.0, 40.0])))
    assert not np.isnan(gravity_tool_face_rad(up))


def test_a_horizontal_axis_is_as_any() -> None:
    """Ahead, level, looking east: x right (south), y down."""
    up, field = np.array([0.0, -9.8, 0.0]), np.array([-34.5, 36.0, 0.0])
    assert inclination_rad(up) == pytest.approx(math.pi / 2)
    assert azimuth_rad(up, field) == pytest.approx(math.pi / 2)
    assert gravity_tool_face_rad(up) == 0.0


def test_nothing_measured_is_no_attitude() -> None:
    nothing = np.zeros(3)
    assert np.isnan(inclination_rad(nothing))
    assert attitude(nothing, FIELD) is None
    assert attitude(np.full(3, np.nan), FIELD) is None
    without_field = attitude(np.array([1.0, 2.0, 3.0]), nothing)
    assert without_field is not None
    assert without_field.magnetic_azimuth_rad is None
    assert without_field.azimuth_rad is None
    assert without_field.magnetic_tool_face_rad is None
    assert without_field.tool_face_rad == without_field.gravity_tool_face_rad


@pytest.mark.parametrize("side", [-1.0, 1.0])
@pytest.mark.parametrize("end", [0.0, math.pi])
def test_near_the_vertical_the_field_takes_over(side: float, end: float) -> None:
    inclination = abs(end - (NEAR_VERTICAL_RAD + side * 1e-6))
    q = orientation(np.asarray(inclination), np.asarray(1.0), np.asarray(2.0))
    found = attitude(rotate(conjugate(q), UP), rotate(conjugate(q), FIELD))
    assert found is not None
    assert (found.azimuth_rad is None) == (side < 0.0)
    expected = found.magnetic_tool_face_rad if side < 0.0 else found.gravity_tool_face_rad
    assert found.tool_face_rad == expected


@quick
@given(turns, st.floats(-math.pi, math.pi))
def test_true_azimuth_adds_the_declination_within_one_turn(magnetic: float, declination: float) -> None:
    true = float(true_azimuth_rad(np.asarray(magnetic), declination))
    assert 0.0 <= true < math.tau
    assert off(true, magnetic + declination) < 1e-9


@pytest.mark.parametrize("angle", [-1e-300, -5e-17, 0.0, math.tau, -math.tau, 1e6])
def test_wrapped_is_within_one_turn(angle: float) -> None:
    assert 0.0 <= float(wrapped(np.asarray(angle))) < math.tau
