from __future__ import annotations

import numpy as np
import pytest

from common.quaternion import heading_turn, rotate
from master.orientation.joints.field import MagneticHeadings

EARTH_UT = np.array([0.0, 25.0, -43.3])
DT_S, SURE = 0.08, np.full(5, np.radians(0.5) ** 2)


def fields(turn_rad: float = 0.0, added_ut: tuple[float, ...] = (0.0, 0.0, 0.0)) -> np.ndarray:
    """(5, 3): the earth's field at all nodes but the first."""
    out = np.tile(EARTH_UT, (5, 1))
    out[0] = rotate(heading_turn(turn_rad), EARTH_UT) + added_ut
    return out


def test_an_undisturbed_field_is_believed() -> None:
    field = MagneticHeadings(5, 30.0)
    theta = np.radians(0.3 * np.arange(5))
    away, disturbed = field.measure(fields(), theta, SURE, DT_S)
    np.testing.assert_allclose(away, -theta, atol=1e-12)
    np.testing.assert_allclose(disturbed, 0.0, atol=1e-6)


@pytest.mark.parametrize(
    ("turn", "added"), [(0.0, (0.0, 0.0, 20.0)), (0.0, (0.0, 20.0, 0.0)), (0.5, (0.0, 0.0, 0.0))]
)
def test_another_field_is_believed_less_and_forgotten_slowly(turn: float, added: tuple[float, ...]) -> None:
    field = MagneticHeadings(5, 30.0)
    field.measure(fields(), np.zeros(5), SURE, DT_S)
    _, disturbed = field.measure(fields(turn, added), np.zeros(5), SURE, DT_S)
    assert disturbed[0] > np.radians(15.0) ** 2
    np.testing.assert_allclose(disturbed[1:], 0.0, atol=1e-6)
    _, after = field.measure(fields(), np.zeros(5), SURE, 30.0)
    assert after[0] == pytest.approx(disturbed[0] / np.e, rel=0.2)


def test_with_an_unsure_heading_a_turned_field_is_no_disturbance() -> None:
    field = MagneticHeadings(5, 30.0)
    _, disturbed = field.measure(fields(0.5), np.zeros(5), np.full(5, 1.0), DT_S)
    np.testing.assert_allclose(disturbed, 0.0, atol=1e-6)


def test_a_node_without_a_magnetometer_says_nothing() -> None:
    field = MagneticHeadings(5, 30.0)
    some = fields()
    some[2] = np.nan
    away, disturbed = field.measure(some, np.ones(5), SURE, DT_S)
    assert away[2] == 0.0
    assert disturbed[2] == np.inf
    assert np.isfinite(disturbed[[0, 1, 3, 4]]).all()
    away, disturbed = field.measure(np.full((5, 3), np.nan), np.ones(5), SURE, DT_S)
    assert not away.any()
    assert np.isinf(disturbed).all()


def test_north_is_where_most_magnetometers_point_after_a_zero_pose() -> None:
    field = MagneticHeadings(5, 30.0)
    known, nodes = np.full(5, 3.0), np.ones(5, dtype=np.bool_)
    field.set_north(nodes, known, fields(0.8))
    away, disturbed = field.measure(fields(0.8), known, SURE, DT_S)
    assert away[0] == pytest.approx(-0.8)
    np.testing.assert_allclose(away[1:], 0.0, atol=1e-12)
    assert disturbed[0] > 10.0 * SURE[0]
