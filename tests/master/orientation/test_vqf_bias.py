"""The biases that weigh a period too long or too short are those of now, not of the start."""

import numpy as np

from common.quaternion import angle_between
from master.orientation.vqf import VqfConfig

PERIOD_S = 0.005
ACC = np.array([[0.0, 0.0, 9.80665]])
NO_FIELD = np.full((1, 3), np.nan)


def test_a_gap_turns_by_the_rate_without_the_bias_that_was_learnt() -> None:
    filter_ = VqfConfig().make(1.0 / PERIOD_S, 1)
    bias = np.radians([[0.0, 0.0, 1.0]])
    for _ in range(4000):
        filter_.update(bias, ACC, NO_FIELD, 1.01 * PERIOD_S)
    assert np.degrees(filter_.bias_rad_s()[0, 2]) > 0.9, "a still unit's bias is learnt"
    before = filter_.q_inertial_from_sensor()
    filter_.update(bias, ACC, NO_FIELD, 0.5)
    assert np.degrees(angle_between(before, filter_.q_inertial_from_sensor())[0]) < 0.06
