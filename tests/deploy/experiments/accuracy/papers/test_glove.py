from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from common.quaternion import Array, from_axis_angle, multiply
from deploy.experiments.accuracy.papers import glove
from deploy.experiments.accuracy.papers.figures import gather
from deploy.sim.suit.imperfections import Imperfections
from deploy.sim.suit.tray import TrayConfig

SHORT_SESSION = TrayConfig(attitudes=20, still_s=2.5, tumble_s=60.0)


@pytest.mark.long
def test_units_as_delivered_meet_every_target_once_calibrated() -> None:
    rows = gather({1: glove.experiment(1, hold_s=1.0, moved_s=10.0, session=SHORT_SESSION)})
    asked = [row for row in rows if row.target is not None]
    assert len(asked) == 9, "the ellipsoid's, and four of each filter"
    for row in asked:
        assert row.outcome == "passed", (row.name, row.values)


def test_uncalibrated_units_miss_them() -> None:
    take = glove.moved(Imperfections("raw", 2, 1), 1, 8.0)
    missed = gather({1: glove.moving_figures(take, glove.orient(take, "vqf")[0])})
    assert [row.outcome for row in missed][:2] == ["failed", "failed"]


def turning(seconds: float) -> Array:
    t_s = np.arange(0.0, seconds, 0.01)
    return from_axis_angle(np.array([0.6, 0.0, 0.8]), 0.7 * np.sin(2.0 * t_s))


def test_a_late_estimate_is_as_late_as_it_is() -> None:
    truth = turning(10.0)
    assert glove.lateness_s(truth[3:], truth[:-3], 100.0) == pytest.approx(0.03, abs=0.002)
    assert glove.lateness_s(truth, truth, 100.0) == pytest.approx(0.0, abs=1e-9)


def test_errors_of_known_size_are_told_by_axis() -> None:
    take = glove.moved(Imperfections("ideal", 2, 1), 1, 8.0)
    tilted = multiply(take.q_world_from_segment, from_axis_angle(np.array([1.0, 0.0, 0.0]), np.radians(2.0)))
    rmse, most, _ = glove.moving_figures(take, np.repeat(tilted, 2, axis=1))
    assert max(rmse.values) == pytest.approx(2.0, abs=1e-6), "roll is the last of the three turns"
    assert min(rmse.values) == pytest.approx(0.0, abs=1e-6)
    assert max(most.values) == pytest.approx(2.0, abs=1e-6)


def test_the_truth_is_turned_as_scipy_says() -> None:
    q = glove.moved(Imperfections("ideal", 2, 2), 2, 8.0).q_world_from_segment[-1, 0]
    expected = Rotation.from_quat(q, scalar_first=True).as_euler("ZYX", degrees=True)
    np.testing.assert_allclose(glove.euler_deg(q[None])[0], expected, atol=1e-9)
