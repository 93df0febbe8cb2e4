from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.errors import ConfigError
from common.skeleton import load_skeleton
from slave.encoders import COUNTS_PER_TURN, RAD_PER_COUNT, Encoders

SKELETON = load_skeleton("nursing")
J = len(SKELETON.joints)
HALF_COUNT = 0.5 * RAD_PER_COUNT + 1e-12

zeros = st.one_of(st.sampled_from([0, 1, 2047, 2048, 4094, 4095]), st.integers(0, COUNTS_PER_TURN - 1))
directions = st.sampled_from([1, -1])
fractions = st.floats(0.0, 1.0)


def mounted(zero: int, direction: int) -> Encoders:
    return Encoders(SKELETON, np.full(J, zero), np.full(J, direction))


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


@pytest.mark.parametrize(
    ("zero", "direction", "says"),
    [(-1, 1, "0 to 4095"), (4096, 1, "0 to 4095"), (0, 0, "1 or -1"), (0, 2, "1 or -1")],
)
def test_a_mounting_that_cannot_be_is_refused_by_joint(zero: int, direction: int, says: str) -> None:
    with pytest.raises(ConfigError, match=f"neck_yaw.*{says}"):
        mounted(zero, direction)


def test_a_table_of_the_wrong_length_is_refused() -> None:
    with pytest.raises(ConfigError, match="25 values"):
        Encoders(SKELETON, [0], np.ones(J))


def test_a_range_of_a_turn_is_refused() -> None:
    wide = replace(SKELETON.joints[0], lower_rad=-np.pi, upper_rad=np.pi)
    skeleton = replace(SKELETON, joints=(wide, *SKELETON.joints[1:]))
    with pytest.raises(ConfigError, match=r"neck_yaw range = '360.0°'"):
        Encoders(skeleton, np.zeros(J), np.ones(J))
