import numpy as np
import pytest

from common.quaternion import (
    Array,
    angle_between,
    conjugate,
    from_rotation_vector,
    heading_rad,
    multiply,
    rotate,
    to_matrix,
)
from master.orientation.mahony import (
    MahonyConfig,
    MahonyFilter,
    attitude_error,
    initial_orientation,
    integrate,
)

from .perfect import FIELD_UT, GRAVITY, NO_FIELD, RATE_HZ, attitudes, seen

GAIN_S = 0.02
"""K_p times the period: a few hundred steps of it settle the loop."""


def inclination_rad(q: Array, truth: Array) -> Array:
    up = rotate(multiply(q, conjugate(truth)), np.array([0.0, 0.0, 1.0]))
    return np.arctan2(np.hypot(up[..., 0], up[..., 1]), up[..., 2])


def correction(q: Array, acc: Array, mag: Array) -> Array:
    return attitude_error(q, acc, mag)[0]


def settle_from(start: Array, truth: Array, error: object = correction, ticks: int = 3000) -> Array:
    """The proportional loop at rest, with a given error formula."""
    q = start
    acc, mag = seen(truth, GRAVITY), seen(truth, FIELD_UT)
    for _ in range(ticks):
        q = integrate(q, error(q, acc, mag), GAIN_S)  # type: ignore[operator]
    return q


def test_starts_at_the_truth_from_one_reading() -> None:
    truth = attitudes(100)
    q = initial_orientation(seen(truth, GRAVITY), seen(truth, FIELD_UT))
    assert np.max(angle_between(q, truth)) < 1e-9


def test_starts_without_a_magnetometer_with_the_shortest_turn() -> None:
    truth = np.concatenate([attitudes(100), [[0.0, 1.0, 0.0, 0.0]], [[1.0, 0.0, 0.0, 0.0]]])
    q = initial_orientation(seen(truth, GRAVITY), np.full((len(truth), 3), np.nan))
    assert np.max(inclination_rad(q, truth)) < 1e-7
    assert np.allclose(q[:, 3], 0.0)


def test_no_error_at_the_truth_and_the_small_error_s_own_axis_near_it() -> None:
    truth = attitudes(50)
    acc, mag = seen(truth, GRAVITY), seen(truth, FIELD_UT)
    assert np.allclose(correction(truth, acc, mag), 0.0, atol=1e-12)
    tilt = 1e-4 * np.random.default_rng(0).normal(size=(50, 3))
    off = multiply(truth, from_rotation_vector(tilt))
    # the correction turns back
    assert np.all(np.sum(correction(off, acc, mag) * tilt, axis=-1) < 0.0)


def test_converges_from_wherever_it_starts() -> None:
    truth = attitudes(60, 1)
    start = multiply(truth, from_rotation_vector(0.6 * np.random.default_rng(1).normal(size=(60, 3))))
    assert np.max(angle_between(settle_from(start, truth), truth)) < np.radians(0.1)


def test_eq_8_as_printed_does_not_converge() -> None:
    def printed(q: Array, acc: Array, mag: Array) -> Array:
        matrix = to_matrix(q)
        a, m = (v / np.linalg.norm(v, axis=-1, keepdims=True) for v in (acc, mag))
        field = np.einsum("nij,nj->ni", matrix, m)
        level = np.stack([0.0 * field[:, 0], np.hypot(field[:, 0], field[:, 1]), field[:, 2]], axis=-1)
        u = np.einsum("nij,nj->ni", matrix, level)  # C_b^n once more
        out: Array = np.cross(a, matrix[:, 2]) + np.cross(m, u)
        return out

    truth = attitudes(60, 1)
    found = settle_from(truth, truth, printed)
    assert np.median(angle_between(found, truth)) > np.radians(20.0)
    assert np.max(angle_between(settle_from(truth, truth), truth)) < np.radians(0.1)


def test_eq_9_as_printed_does_not_converge() -> None:
    def printed(q: Array, acc: Array, mag: Array) -> Array:
        v = to_matrix(q)[:, 2]
        a, m = (w / np.linalg.norm(w, axis=-1, keepdims=True) for w in (acc, mag))
        out: Array = np.cross(a, v) + np.cross(m, v)  # m̂ × v̂
        return out

    truth = attitudes(60, 1)
    start = multiply(from_rotation_vector(np.array([0.0, 0.0, 1.0])), truth)
    found = settle_from(start, truth, printed)
    # it pulls "up" toward the field, and knows no heading
    assert np.median(inclination_rad(found, truth)) > np.radians(20.0)
    assert np.max(angle_between(settle_from(start, truth), truth)) < np.radians(0.1)


def test_integration_is_of_first_order() -> None:
    q = attitudes(10)
    rate = np.random.default_rng(2).normal(size=(10, 3))
    exact = multiply(q, from_rotation_vector(rate / RATE_HZ))
    assert np.max(angle_between(integrate(q, rate, 1.0 / RATE_HZ), exact)) < 1e-6
    assert np.allclose(np.linalg.norm(integrate(q, 100.0 * rate, 1.0 / RATE_HZ), axis=-1), 1.0)


def run(filter_: MahonyFilter, truth: Array, gyr: Array, ticks: int, field: Array = FIELD_UT) -> None:
    for _ in range(ticks):
        filter_.update(gyr, seen(truth, GRAVITY), seen(truth, field))


def test_follows_a_turning_sensor() -> None:
    rng = np.random.default_rng(3)
    truth = attitudes(8, 3)
    filter_ = MahonyFilter(MahonyConfig(), RATE_HZ, 8)
    filter_.update(np.zeros((8, 3)), seen(truth, GRAVITY), seen(truth, FIELD_UT))
    phase, speed = rng.uniform(0.0, 6.0, (8, 3)), rng.uniform(1.0, 4.0, (8, 3))
    for tick in range(2000):
        rate = 3.0 * np.sin(speed * tick / RATE_HZ + phase)
        truth = multiply(truth, from_rotation_vector(rate / RATE_HZ))
        filter_.update(rate, seen(truth, GRAVITY), seen(truth, FIELD_UT))
        assert np.max(angle_between(filter_.q_world_from_sensor(), truth)) < np.radians(0.1)


def test_learns_the_gyro_s_bias_through_k_i() -> None:
    truth, bias = attitudes(1, 4), np.full((1, 3), 0.02)
    learning = MahonyFilter(MahonyConfig(ki=0.1), RATE_HZ, 1)
    run(learning, truth, bias, 10_000)
    assert np.allclose(learning.bias_rad_s(), bias, atol=1e-3)
    assert np.max(angle_between(learning.q_world_from_sensor(), truth)) < np.radians(0.2)
    proportional = MahonyFilter(MahonyConfig(ki=0.0), RATE_HZ, 1)
    run(proportional, truth, bias, 4000)
    assert np.array_equal(proportional.bias_rad_s(), np.zeros((1, 3)))
    assert np.min(angle_between(proportional.q_world_from_sensor(), truth)) > np.radians(0.5)


@pytest.mark.parametrize(("limit", "bounded"), [(0.01, True), (0.0, False)])
def test_the_integral_stays_within_its_limit(limit: float, bounded: bool) -> None:
    truth, bias = attitudes(1, 4), np.full((1, 3), 0.05)
    filter_ = MahonyFilter(
        MahonyConfig(ki=0.1, bias_limit_rad_s=limit, rest_bias_limit_deg_s=0.0), RATE_HZ, 1
    )
    run(filter_, truth, bias, 2000)
    assert bool(np.all(np.abs(filter_.bias_rad_s()) <= 0.01)) == bounded


def test_a_row_without_a_magnetometer_keeps_its_inclination() -> None:
    truth = attitudes(6, 5)
    acc, mag = seen(truth, GRAVITY), seen(truth, FIELD_UT)
    nine, mixed = MahonyFilter(MahonyConfig(), RATE_HZ, 6), MahonyFilter(MahonyConfig(), RATE_HZ, 6)
    some = mag.copy()
    some[2] = NO_FIELD
    rate = np.random.default_rng(5).normal(size=(6, 3))
    for _ in range(50):
        nine.update(rate, acc, mag)
        mixed.update(rate, acc, some)
    others = np.arange(6) != 2
    found, expected = mixed.q_world_from_sensor(), nine.q_world_from_sensor()
    assert np.array_equal(found[others], expected[others])
    assert np.all(np.isfinite(found))
    still = MahonyFilter(MahonyConfig(), RATE_HZ, 1)
    run(still, truth[:1], np.zeros((1, 3)), 100, NO_FIELD)
    assert inclination_rad(still.q_world_from_sensor(), truth[:1])[0] < 1e-6


def test_free_fall_pulls_at_nothing() -> None:
    q = attitudes(3)
    assert np.array_equal(correction(q, np.zeros((3, 3)), np.full((3, 3), np.nan)), np.zeros((3, 3)))


def test_restart_takes_the_next_reading_and_only_for_the_nodes_named() -> None:
    truth, other = attitudes(2, 6), attitudes(2, 7)
    filter_ = MahonyFilter(MahonyConfig(), RATE_HZ, 2)
    run(filter_, truth, np.zeros((2, 3)), 10)
    filter_.restart(np.array([False, True]))
    run(filter_, other, np.zeros((2, 3)), 1)
    errors = angle_between(filter_.q_world_from_sensor(), other)
    assert errors[1] < 1e-6
    assert errors[0] > 0.1


def test_heading_comes_from_the_magnetometer_north_being_y() -> None:
    level = initial_orientation(GRAVITY[None], np.array([[28.0, 0.0, -39.0]]))
    # the sensor's x looks north: a quarter turn to the left of east
    assert float(heading_rad(level)[0]) == pytest.approx(np.pi / 2)
