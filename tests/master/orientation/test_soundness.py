"""No reading of any channel spoils a filter for longer than it lasts."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from common.quaternion import Array, angle_between
from master.orientation.affine import identity
from master.orientation.config import EstimationConfig
from master.orientation.estimator import Estimator
from master.orientation.filter import OrientationFilter
from master.orientation.filters import FILTERS
from master.orientation.soundness import Soundness
from master.suit.doubt import Weight

from .perfect import Node, attitudes, seen_by
from .test_estimator import QUICK

RATE_HZ = 200.0
NAMES = ("vqf", "mahony", "ekf")
ABSURD = (np.nan, np.inf, -np.inf, 1e30, -1e30, 1e308, 3.4e38, 500.0 * 2000.0 * 1e3)

Wrong = tuple[int, int, int, float]
"""Tick, sensor (gyr, acc, mag), axis, value."""


def run(filter_: OrientationFilter, truth: Array, ticks: int, wrong: list[Wrong]) -> None:
    sound = seen_by(truth, np.zeros((len(truth), 3)))
    for tick in range(ticks):
        parts = [sound.gyr_rad_s.copy(), sound.acc_m_s2.copy(), sound.mag_ut.copy()]
        for at, sensor, axis, value in wrong:
            if at == tick:
                parts[sensor][0, axis] = value
        filter_.update(parts[0], parts[1], parts[2])


@pytest.mark.parametrize("name", NAMES)
@settings(max_examples=25, deadline=None)
@given(
    wrong=st.lists(
        st.tuples(
            st.integers(5, 40), st.integers(0, 2), st.integers(0, 2),
            st.one_of(st.sampled_from(ABSURD), st.floats(2e7, 1e308)),
        ),
        max_size=12,
    )
)  # fmt: skip
def test_it_survives_whatever_a_channel_says(name: str, wrong: list[Wrong]) -> None:
    truth, filter_ = attitudes(2), FILTERS[name]().make(RATE_HZ, 2)
    run(filter_, truth, 60, wrong)
    # a start with few fields takes longer to find north
    assert np.max(angle_between(filter_.q_world_from_sensor(), truth)) < np.radians(10.0)
    assert np.all(np.isfinite(filter_.bias_rad_s()))
    # what takes a whole field's place is a magnetometer that is missing
    assert filter_.skipped[1] == 0
    ticks = {at for at, sensor, _, _ in wrong if sensor < 2}
    assert len(ticks) <= filter_.skipped[0] <= len({at for at, *_ in wrong})


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("value", ABSURD)
def test_one_wrong_value_leaves_no_trace_behind_the_low_pass(name: str, value: float) -> None:
    config = EstimationConfig.model_validate({"filter": name, "settle_s": 0.1})
    for sensor in ("gyr_rad_s", "acc_m_s2", "mag_ut"):
        truth = attitudes(2)
        subject = Estimator(config, [Node()] * 2, RATE_HZ, identity(2))
        sound = seen_by(truth, np.zeros((2, 3)))
        for tick in range(300):
            spoilt = getattr(sound, sensor).copy()
            if tick == 200:
                spoilt[0, 1] = value
            subject.update(replace(sound, **{sensor: spoilt}))
            if tick >= 100:
                posture = subject.posture()
                assert np.max(angle_between(posture.q_world_from_segment, truth)) < np.radians(1.0)
                assert np.abs(posture.rate_rad_s).max() < 0.1


def test_a_node_that_gives_no_numbers_is_named_and_invalid() -> None:
    truth = attitudes(2)
    subject = Estimator(QUICK, [Node()] * 2, RATE_HZ, identity(2))
    sound = seen_by(truth, np.zeros((2, 3)))
    for _ in range(200):
        subject.update(sound)
    assert subject.doubts() == {}
    acc = sound.acc_m_s2.copy()
    acc[1, 2] = np.nan
    subject.update(replace(sound, acc_m_s2=acc))
    for _ in range(41):
        subject.update(sound)
    (doubt,) = subject.doubts().values()
    assert doubt.weight is Weight.NOTED
    assert doubt.words == "1 readings were no numbers, or beyond any sensor's range"
    for _ in range(41):
        subject.update(replace(sound, acc_m_s2=acc))
    assert subject.doubts()[1].weight is Weight.INVALID


def test_sound_readings_are_handed_on_as_they_are() -> None:
    sound = Soundness(2)
    parts = [np.ones((2, 3)), np.full((2, 3), 9.0), np.full((2, 3), 50.0)]
    assert all(a is b for a, b in zip(sound.take(*parts), parts, strict=True))
    assert sound.magnetic.all()
    parts[2][1] = np.nan
    gyr, acc, mag = sound.take(*parts)
    assert gyr is parts[0]
    assert acc is parts[1]
    assert sound.magnetic.tolist() == [True, False]
    assert sound.spoilt is None
    parts[2][0, 1] = np.nan
    gyr, acc, mag = sound.take(*parts)
    assert np.isnan(mag[0]).all()
    assert sound.skipped.tolist() == [1, 0]
