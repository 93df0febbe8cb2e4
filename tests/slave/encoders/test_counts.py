from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from common.errors import ConfigError
from common.skeleton import load_skeleton
from slave.encoders.counts import COUNTS_PER_TURN, RAD_PER_COUNT, EncoderConfig, Encoders

SKELETON = load_skeleton("nursing")
J = len(SKELETON.joints)
HALF_COUNT = 0.5 * RAD_PER_COUNT + 1e-12

zeros = st.one_of(st.sampled_from([0, 1, 2047, 2048, 4094, 4095]), st.integers(0, COUNTS_PER_TURN - 1))
directions = st.sampled_from([1, -1])
fractions = st.floats(0.0, 1.0)


def mounted(zero: int, direction: int) -> Encoders:
    names = SKELETON.joint_names
    reversed_joints = list(names) if direction < 0 else []
    return Encoders(SKELETON, EncoderConfig(zero_counts=dict.fromkeys(names, zero), reversed=reversed_joints))


@given(zeros, directions, fractions)
def test_every_angle_of_every_range_comes_back_within_half_a_count(
    zero: int, direction: int, fraction: float
) -> None:
    position = SKELETON.lower_rad + fraction * (SKELETON.upper_rad - SKELETON.lower_rad)
    encoders = mounted(zero, direction)
    counts = encoders.counts(position)
    assert counts.min() >= 0
    assert counts.max() < COUNTS_PER_TURN
    assert np.abs(encoders.position_rad(counts) - position).max() <= HALF_COUNT


@given(zeros, directions, st.integers(0, COUNTS_PER_TURN - 1))
def test_every_count_comes_back_as_itself(zero: int, direction: int, count: int) -> None:
    encoders = mounted(zero, direction)
    counts = np.full(J, count)
    assert (encoders.counts(encoders.position_rad(counts)) == counts).all()


@given(zeros, directions, st.integers(0, COUNTS_PER_TURN - 1))
def test_the_angle_is_the_one_nearest_the_middle_of_the_range(zero: int, direction: int, count: int) -> None:
    middle = 0.5 * (SKELETON.lower_rad + SKELETON.upper_rad)
    position = mounted(zero, direction).position_rad(np.full(J, count))
    assert np.abs(position - middle).max() <= np.pi + RAD_PER_COUNT


def test_the_resolution_is_that_of_12_bits() -> None:
    assert np.rad2deg(RAD_PER_COUNT) == pytest.approx(0.0879, abs=1e-4)


def test_a_count_past_the_wrap_is_a_small_step() -> None:
    encoders = mounted(4095, 1)
    before, after = (encoders.position_rad(np.full(J, c)) for c in (4095, 0))
    np.testing.assert_allclose(after - before, RAD_PER_COUNT)


def test_a_reversed_encoder_counts_down() -> None:
    encoders = mounted(0, -1)
    assert (encoders.counts(np.full(J, RAD_PER_COUNT)) == 4095).all()
    np.testing.assert_allclose(encoders.position_rad(np.full(J, 4095)), RAD_PER_COUNT)


@pytest.mark.parametrize("zero", [-1, 4096])
def test_a_zero_count_that_no_encoder_shows_is_refused(zero: int) -> None:
    with pytest.raises(ValidationError, match="neck_yaw"):
        EncoderConfig(zero_counts={"neck_yaw": zero})


@pytest.mark.parametrize(
    ("config", "key"),
    [
        (EncoderConfig(zero_counts={"knee": 1}), "encoders.zero_counts.knee"),
        (EncoderConfig(reversed=["knee"]), "encoders.reversed"),
    ],
)
def test_a_joint_that_does_not_exist_is_refused(config: EncoderConfig, key: str) -> None:
    with pytest.raises(ConfigError, match=f"{key} = 'knee': expected a joint of the nursing profile"):
        Encoders(SKELETON, config)


def test_a_range_of_a_turn_is_refused() -> None:
    wide = replace(SKELETON.joints[0], lower_rad=-np.pi, upper_rad=np.pi)
    skeleton = replace(SKELETON, joints=(wide, *SKELETON.joints[1:]))
    with pytest.raises(ConfigError, match=r"neck_yaw.range = '360.0°'"):
        Encoders(skeleton)
