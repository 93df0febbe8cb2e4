from __future__ import annotations

import numpy as np
import pytest

from common.quaternion import conjugate
from deploy.experiments.accuracy.papers import lower_limb
from deploy.experiments.accuracy.papers.figures import gather
from deploy.experiments.accuracy.papers.fixture import SensorTake


def test_axes_and_knees_meet_their_targets_with_sensors_askew() -> None:
    rows = gather({1: lower_limb.experiment(1)})
    asked = [row for row in rows if row.target is not None]
    assert [row.name for row in asked] == ["hinge axes in both sensors' frames", "knee angle, RMSE"]
    for row in asked:
        assert row.outcome == "passed", (row.name, row.values)


def test_an_alignment_that_is_off_shows_in_the_knees_angle() -> None:
    q_segment_from_sensor = lower_limb.askew(1)
    whole = lower_limb.walk(1, "ideal", q_segment_from_sensor)
    some = slice(0, 1600)
    take = SensorTake(
        whole.rate_hz, whole.samples[some], whole.position_rad[some], whole.q_world_from_segment[some]
    )
    right = lower_limb.knee_errors_deg(take, conjugate(q_segment_from_sensor))
    assert np.sqrt(np.mean(right**2)) < 0.05
    unaware = np.tile([1.0, 0.0, 0.0, 0.0], (len(q_segment_from_sensor), 1))
    assert np.sqrt(np.mean(lower_limb.knee_errors_deg(take, unaware) ** 2)) > 5.0


def test_sensors_sit_as_far_askew_as_is_said() -> None:
    turned_deg = 2.0 * np.degrees(np.arccos(np.abs(lower_limb.askew(3)[:, 0])))
    assert turned_deg == pytest.approx(40.0)
