"""The zero pose taken again while the suit is worn: headings anew, a bad pose changes nothing."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from common.quaternion import Array, angle_between, from_rotation_vector, heading_turn
from common.skeleton import load_skeleton
from master.orientation.affine import identity
from master.orientation.config import EstimationConfig
from master.orientation.estimator import Estimator
from master.orientation.zero_pose_again import spread_deg

from .perfect import RATE_HZ, Node, seen_by

COUNT = 7
NAMES = load_skeleton("lower_limb").segment_names
STAND_TICKS = 40


def worn(constraints: str = "off", aligned: bool = True) -> Estimator:
    """A suit of six-axis nodes whose first zero pose has been taken."""
    config = EstimationConfig.model_validate(
        {"settle_s": 0.1, "zero_pose_s": STAND_TICKS / RATE_HZ, "constraints": constraints}
    )
    calibration = replace(identity(COUNT), alignment_made=np.full(COUNT, aligned))
    subject = Estimator(config, [Node()] * COUNT, RATE_HZ, calibration, load_skeleton("lower_limb"))
    stand(subject, upright(), 100)
    assert subject.has_zero_pose
    return subject


def upright(turned_deg: Any = 0.0) -> Array:
    return heading_turn(np.radians(np.broadcast_to(turned_deg, COUNT)))


def stand(subject: Estimator, q: Array, ticks: int, rate_rad_s: Array | None = None) -> None:
    rate = np.zeros((COUNT, 3)) if rate_rad_s is None else rate_rad_s
    readings = replace(seen_by(q, rate), mag_ut=np.full((COUNT, 3), np.nan))
    for _ in range(ticks):
        subject.update(readings)


def drift(subject: Estimator, deg: Array) -> None:
    """The headings drift by so much: the gyros turn while the person stands."""
    ticks = 200
    rate = np.zeros((COUNT, 3))
    rate[:, 2] = np.radians(deg) / (ticks / RATE_HZ)
    stand(subject, upright(), ticks, rate)


def off_deg(subject: Estimator) -> Array:
    return np.degrees(angle_between(subject.posture().q_world_from_segment, upright()))


@pytest.mark.parametrize("constraints", ["off", "online"])
@pytest.mark.parametrize("aligned", [True, False])
def test_headings_that_have_drifted_are_right_again(constraints: str, aligned: bool) -> None:
    subject = worn(constraints, aligned)
    drifted = np.array([0.0, 8.0, -12.0, 3.0, 0.0, 0.0, 5.0])
    drift(subject, drifted)
    assert off_deg(subject).max() > 5.0
    again = subject.stand_again()
    stand(subject, upright(), STAND_TICKS - 1)
    assert not again.taken.any()
    assert off_deg(subject).max() > 5.0, "until it is complete the old one stands"
    stand(subject, upright(), 1)
    assert again.taken.all()
    assert off_deg(subject).max() < 0.5
    if constraints == "off":
        assert np.allclose(spread_deg(again.moved_rad), -drifted, atol=0.5)


@pytest.mark.parametrize("aligned", [True, False])
def test_who_leans_is_refused_in_words_and_the_old_one_stays(aligned: bool) -> None:
    subject = worn(aligned=aligned)
    q = upright()
    q[2] = from_rotation_vector(np.array([0.0, np.radians(25.0), 0.0]))
    # the filter must know of the lean before the pose begins
    turn = np.zeros((COUNT, 3))
    turn[2, 1] = np.radians(25.0)
    stand(subject, q, round(RATE_HZ), turn)
    stand(subject, q, 200)
    again = subject.stand_again()
    stand(subject, q, 3 * STAND_TICKS)
    assert not again.taken.any()
    assert re.fullmatch(rf"{NAMES[2]} leaned by 2\d°, at most 15 is upright", again.words(NAMES))
    subject.drop_again()
    assert off_deg(subject)[2] > 20.0, "the old one stands"


def test_who_moves_is_refused_in_words_and_the_old_one_stays() -> None:
    rate = np.zeros((COUNT, 3))
    rate[3, 2] = np.radians(20.0)
    subject = worn()
    before = subject.posture().q_world_from_segment[:3]
    again = subject.stand_again()
    stand(subject, upright(), 3 * STAND_TICKS, rate)
    assert not again.taken.any()
    assert again.words(NAMES) == f"{NAMES[3]} turned at 20°/s, at most 15 is standing still"
    subject.drop_again()
    stand(subject, upright(), 3 * STAND_TICKS)
    assert np.degrees(angle_between(subject.posture().q_world_from_segment[:3], before)).max() < 0.1


def test_a_node_that_is_lost_keeps_what_it_had() -> None:
    subject = worn()
    again = subject.stand_again()
    readings = replace(seen_by(upright(), np.zeros((COUNT, 3))), mag_ut=np.full((COUNT, 3), np.nan))
    lost = np.arange(COUNT) == 5
    for _ in range(STAND_TICKS + 1):
        subject.update(replace(readings, fresh=~lost, lost=lost))
    assert again.taken.tolist() == (~lost).tolist()


def test_the_operator_may_face_elsewhere() -> None:
    subject = worn()
    turn = np.zeros((COUNT, 3))
    turn[:, 2] = np.radians(40.0)
    stand(subject, upright(), round(RATE_HZ), turn)
    stand(subject, upright(), 20)  # the gyro's low-pass
    again = subject.stand_again()
    stand(subject, upright(), STAND_TICKS)
    assert again.taken.all()
    assert off_deg(subject).max() < 0.5
    assert np.abs(spread_deg(again.moved_rad)).max() < 0.1
