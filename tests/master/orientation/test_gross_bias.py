"""At rest a bias of any size is learnt, or its node is called uncalibrated; a turn is not taken for one."""

import re

import numpy as np
import pytest

from common.quaternion import Array, angle_between, conjugate, from_rotation_vector, multiply, rotate
from master.orientation.affine import identity
from master.orientation.config import EstimationConfig
from master.orientation.estimator import Estimator
from master.orientation.filter import OrientationFilter
from master.orientation.filters import FILTERS
from master.orientation.vqf import VqfConfig
from master.suit.doubt import Weight

from .perfect import FIELD_UT, GRAVITY, Node, attitudes, seen_by

RATE_HZ = 200.0
NAMES = ("vqf", "mahony", "ekf")


def run(filter_: OrientationFilter, bias_deg_s: Array, seconds: float, *, field: bool, turn: Array) -> Array:
    """Sensors that turn at `turn` °/s (n, 3), own axes, with noise; the last truth (n, 4)."""
    n, rng = len(bias_deg_s), np.random.default_rng(0)
    q, rate = attitudes(n), np.radians(turn)
    for _ in range(round(seconds * RATE_HZ)):
        q = multiply(q, from_rotation_vector(rate / RATE_HZ))
        acc = rotate(conjugate(q), np.broadcast_to(GRAVITY, (n, 3))) + 0.05 * rng.normal(size=(n, 3))
        mag = rotate(conjugate(q), np.broadcast_to(FIELD_UT, (n, 3))) + 0.5 * rng.normal(size=(n, 3))
        gyr = rate + np.radians(bias_deg_s + 0.1 * rng.normal(size=(n, 3)))
        filter_.update(gyr, acc, mag if field else np.full((n, 3), np.nan))
    return q


def upright(count: int, deg_s: float) -> Array:
    """A turn about the vertical, in the sensors' axes, °/s."""
    return deg_s * rotate(conjugate(attitudes(count)), np.tile([0.0, 0.0, 1.0], (count, 1)))


BIASES = np.array([[5.0, 0.0, 0.0], [0.0, -5.0, 0.0], [0.0, 0.0, 3.0], [4.0, -9.0, 15.0], [2.1, 2.1, 2.1]])


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("field", [True, False])
def test_a_gross_bias_is_learnt_at_rest(name: str, field: bool) -> None:
    filter_ = FILTERS[name]().make(RATE_HZ, len(BIASES))
    truth = run(filter_, BIASES, 6.0, field=field, turn=np.zeros_like(BIASES))
    assert np.abs(np.degrees(filter_.bias_rad_s()) - BIASES).max() < 0.2
    assert {node: doubt.weight for node, doubt in filter_.doubts().items()} == dict.fromkeys(
        range(len(BIASES)), Weight.NOTED
    )
    words = r"its gyro reads 1[45]\.[019]°/s at rest, which is taken off; calibrate it"
    assert re.fullmatch(words, filter_.doubts()[3].words)
    before = filter_.q_world_from_sensor()
    run(filter_, BIASES, 10.0, field=field, turn=np.zeros_like(BIASES))
    # 41° a minute before
    assert np.degrees(angle_between(filter_.q_world_from_sensor(), before).max()) < 1.0
    if field:
        assert np.degrees(angle_between(filter_.q_world_from_sensor(), truth).max()) < 1.0


@pytest.mark.parametrize("name", NAMES)
def test_beyond_the_setting_the_node_is_called_uncalibrated(name: str) -> None:
    filter_ = FILTERS[name]().make(RATE_HZ, 2)
    run(filter_, np.array([[0.0, 21.0, 0.0], [0.0, 19.0, 0.0]]), 4.0, field=True, turn=np.zeros((2, 3)))
    doubts = filter_.doubts()
    assert doubts[0].weight is Weight.INVALID
    assert "uncalibrated: its gyro reads 2" in doubts[0].words
    assert doubts[1].weight is Weight.NOTED


def test_the_bound_is_a_setting() -> None:
    filter_ = VqfConfig(rest_bias_limit_deg_s=4.0).make(RATE_HZ, 1)
    run(filter_, np.array([[5.0, 0.0, 0.0]]), 4.0, field=True, turn=np.zeros((1, 3)))
    assert filter_.doubts()[0].weight is Weight.INVALID


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("deg_s", [3.0, 6.0, 15.0])
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_steady_turn_is_no_bias(name: str, deg_s: float, axis: int) -> None:
    """Gravity tells it about a level axis, the field about the vertical."""
    filter_ = FILTERS[name]().make(RATE_HZ, 3)
    level = np.zeros(3)
    level[axis] = deg_s
    turn = rotate(conjugate(attitudes(3)), np.tile(level, (3, 1))) if axis == 2 else np.tile(level, (3, 1))
    if axis < 2:
        # about a sensor's axis that lies level: turn the sensors' axes so that it does
        turn = np.cross(rotate(conjugate(attitudes(3)), np.tile([0.0, 0.0, 1.0], (3, 1))), np.eye(3)[axis])
        turn *= deg_s / np.linalg.norm(turn, axis=1, keepdims=True)
    run(filter_, np.zeros((3, 3)), 8.0, field=True, turn=turn)
    assert filter_.doubts() == {}
    assert np.abs(np.degrees(filter_.bias_rad_s())).max() < 2.0


@pytest.mark.parametrize("name", NAMES)
def test_without_a_field_a_wavering_turn_is_no_bias(name: str) -> None:
    filter_, rng, n = FILTERS[name]().make(RATE_HZ, 1), np.random.default_rng(1), 1
    up = rotate(conjugate(attitudes(n)), np.tile([0.0, 0.0, 1.0], (n, 1)))
    acc = rotate(conjugate(attitudes(n)), np.broadcast_to(GRAVITY, (n, 3)))
    wander = 0.0
    for tick in range(2000):
        wander += 0.02 * (-wander) + 0.25 * rng.normal()
        rate = np.radians(6.0 + wander + 1.5 * np.sin(2.0 * np.pi * 1.1 * tick / RATE_HZ)) * up
        filter_.update(rate, acc, np.full((n, 3), np.nan))
    assert filter_.doubts() == {}


@pytest.mark.parametrize("name", NAMES)
def test_a_steady_rate_is_undecided_until_it_is_learnt(name: str) -> None:
    filter_, still = FILTERS[name]().make(RATE_HZ, 3), np.zeros((3, 3))
    biases = np.array([[0.0, 12.0, 0.0], [0.0, 0.0, 25.0], [0.5, 0.0, 0.0]])
    run(filter_, biases, 1.0, field=True, turn=still)
    assert filter_.undecided().tolist() == [True, True, False]
    run(filter_, biases, 3.0, field=True, turn=still)
    assert filter_.undecided().tolist() == [False, True, False]


@pytest.mark.parametrize("name", NAMES)
def test_a_person_who_turns_is_not_undecided(name: str) -> None:
    filter_ = FILTERS[name]().make(RATE_HZ, 1)
    for tick in range(400):
        rate = np.radians(25.0 + 5.0 * np.sin(2.0 * np.pi * tick / RATE_HZ)) * upright(1, 1.0)
        filter_.update(rate, GRAVITY[None] * np.ones((1, 3)), np.full((1, 3), np.nan))
        assert not filter_.undecided().any()


@pytest.mark.parametrize(("deg_s", "weight"), [(12.0, Weight.REFUSED), (25.0, Weight.INVALID)])
def test_a_gross_bias_does_not_keep_others_from_their_zero_pose(deg_s: float, weight: Weight) -> None:
    config = EstimationConfig(settle_s=1.0, zero_pose_s=1.5)
    estimator = Estimator(config, [Node()] * 3, RATE_HZ, identity(3))
    noise, bias = np.random.default_rng(2), np.zeros((3, 3))
    bias[1, 0] = np.radians(deg_s)
    for tick in range(1400):
        if tick == 520:
            # 0.1 s after settling and the pose; the bias of 12°/s has just been learnt
            assert estimator.posture().valid.tolist() == [True, False, True]
            assert estimator.doubts()[1].weight is weight
        estimator.update(seen_by(attitudes(3), bias + 0.002 * noise.normal(size=(3, 3))))
    assert estimator.posture().valid.tolist() == [True, deg_s < 20.0, True]
    assert all(doubt.weight < Weight.REFUSED for doubt in estimator.doubts().values())
