"""What every orientation filter must do, whichever it is.

To hold a filter to it, subclass `FilterContract` and give the fixture `section`:

    class TestMyFilter(FilterContract):
        @pytest.fixture
        def section(self) -> FilterSection:
            return MyConfig()
"""

import numpy as np
import pytest

from common.quaternion import Array, angle_between, conjugate, from_rotation_vector, multiply, rotate
from master.orientation.filter import FilterSection, OrientationFilter
from master.orientation.mahony import MahonyConfig

from .perfect import FIELD_UT, GRAVITY, NO_FIELD, RATE_HZ, attitudes, seen

UP = np.array([0.0, 0.0, 1.0])
NODES = 3


def make(section: FilterSection) -> OrientationFilter:
    return section.make(RATE_HZ, NODES)


def inclination_deg(q: Array, truth: Array) -> float:
    up = rotate(multiply(q, conjugate(truth)), UP)
    return float(np.degrees(np.max(np.arctan2(np.hypot(up[:, 0], up[:, 1]), up[:, 2]))))


def off_deg(q: Array, truth: Array) -> float:
    return float(np.degrees(np.max(angle_between(q, truth))))


def rate_at(time_s: float, seed: int = 0) -> Array:
    rng = np.random.default_rng(seed)
    phase, speed = rng.uniform(0.0, 6.0, (NODES, 3)), rng.uniform(0.5, 3.0, (NODES, 3))
    return np.sin(speed * time_s + phase)


def move(
    filter_: OrientationFilter,
    truth: Array,
    dts_s: Array,
    field: Array = FIELD_UT,
    tell_dt: bool = True,
    start_s: float = 0.0,
) -> Array:
    """Turn by `rate_at` with those times between readings; the truth at the end."""
    time_s = start_s
    for dt_s in dts_s:
        rate = rate_at(time_s + 0.5 * dt_s)
        time_s += dt_s
        truth = multiply(truth, from_rotation_vector(rate * dt_s))
        mag = seen(truth, field)
        filter_.update(rate, seen(truth, GRAVITY), mag, float(dt_s) if tell_dt else None)
    return truth


def rest(filter_: OrientationFilter, truth: Array, ticks: int, field: Array = FIELD_UT) -> None:
    still, acc, mag = np.zeros((NODES, 3)), seen(truth, GRAVITY), seen(truth, field)
    for _ in range(ticks):
        filter_.update(still, acc, mag)


class FilterContract:
    """Tests of one filter, made from the fixture `section`, over simulated nodes with exact sensors."""

    def test_starts_from_a_still_pose_at_once_and_stays(self, section: FilterSection) -> None:
        filter_, truth = make(section), attitudes(NODES)
        rest(filter_, truth, 1)
        assert off_deg(filter_.q_world_from_sensor(), truth) < 0.1
        rest(filter_, truth, 600)
        assert off_deg(filter_.q_world_from_sensor(), truth) < 0.1
        assert np.max(np.abs(filter_.bias_rad_s())) < 1e-3

    def test_the_nominal_period_told_is_the_nominal_period_untold(self, section: FilterSection) -> None:
        told, untold, dts_s = (
            make(section),
            make(section),
            np.full(100, 1.0 / RATE_HZ),
        )
        move(told, attitudes(NODES), dts_s)
        move(untold, attitudes(NODES), dts_s, tell_dt=False)
        assert np.array_equal(told.q_world_from_sensor(), untold.q_world_from_sensor())

    @pytest.mark.parametrize("seed", [0, 17, 444, 1000])
    def test_follows_a_motion_read_at_uneven_times(self, section: FilterSection, seed: int) -> None:
        filter_, truth = make(section), attitudes(NODES, seed)
        rest(filter_, truth, 100)
        dts_s = np.random.default_rng(seed).uniform(0.002, 0.012, 400)
        truth = move(filter_, truth, dts_s)
        assert off_deg(filter_.q_world_from_sensor(), truth) < 0.5

    def test_uneven_times_left_untold_do_harm(self, section: FilterSection) -> None:
        filter_, truth = make(section), attitudes(NODES, 1)
        rest(filter_, truth, 100)
        truth = move(filter_, truth, np.full(200, 0.012), tell_dt=False)
        assert off_deg(filter_.q_world_from_sensor(), truth) > 3.0

    def test_a_gap_is_bridged_by_the_turn_told_and_costs_little(self, section: FilterSection) -> None:
        filter_, truth = make(section), attitudes(NODES, 2)
        rest(filter_, truth, 100)
        gaps_s = np.full(300, 1.0 / RATE_HZ)
        gaps_s[100::50] = 20.0 / RATE_HZ
        truth = move(filter_, truth, gaps_s)
        assert off_deg(filter_.q_world_from_sensor(), truth) < 1.0

    def test_a_gap_turns_by_the_rate_less_its_bias(self, section: FilterSection) -> None:
        """Rest teaches the bias; a long gap must not integrate it."""
        filter_, truth, bias = make(section), attitudes(NODES, 3), np.full((NODES, 3), 0.01)
        acc, no_field = seen(truth, GRAVITY), np.tile(NO_FIELD, (NODES, 1))
        for _ in range(1000):
            filter_.update(bias, acc, no_field)
        before, learnt = filter_.q_world_from_sensor(), filter_.bias_rad_s()
        filter_.update(bias, acc, no_field, 2.0)
        turned = angle_between(before, filter_.q_world_from_sensor())
        expected = np.linalg.norm(2.0 * (bias - learnt), axis=1)
        # the accelerometer takes back some of it
        assert np.all(turned <= expected + 2e-3)

    def test_a_disturbed_field_never_touches_the_inclination(self, section: FilterSection) -> None:
        clean, disturbed = make(section), make(section)
        truth = attitudes(NODES, 4)
        for filter_ in (clean, disturbed):
            rest(filter_, truth, 200)
        dts_s = np.full(600, 1.0 / RATE_HZ)
        move(clean, truth, dts_s)
        end = move(disturbed, truth, dts_s, FIELD_UT + [25.0, -20.0, 30.0])
        ends = [filter_.q_world_from_sensor() for filter_ in (clean, disturbed)]
        assert inclination_deg(ends[1], end) < 0.3
        # mahony learns one bias from both sensors, by K_i, so that a trace of it shows
        if not isinstance(section, MahonyConfig):
            assert inclination_deg(ends[1], ends[0]) < 1e-6

    def test_a_field_of_another_strength_is_left_out(self, section: FilterSection) -> None:
        filter_ = make(section)
        # vqf takes a field for the usual one after 5 s of motion
        truth = move(filter_, attitudes(NODES, 5), np.full(1800, 1.0 / RATE_HZ))
        # by direction the field is then 55° off
        end = move(filter_, truth, np.full(600, 1.0 / RATE_HZ), FIELD_UT + [40.0, 0.0, 0.0])
        assert off_deg(filter_.q_world_from_sensor(), end) <= 3.0

    def test_without_the_magnetometer_only_the_heading_differs(self, section: FilterSection) -> None:
        filter_, truth = make(section), attitudes(NODES, 6)
        rest(filter_, truth, 100)
        move(filter_, truth, np.full(300, 1.0 / RATE_HZ), FIELD_UT + [10.0, 0.0, 0.0])
        between = multiply(filter_.q_inertial_from_sensor(), conjugate(filter_.q_world_from_sensor()))
        assert np.allclose(between[:, 1:3], 0.0, atol=1e-9)

    def test_the_inertial_orientation_ignores_the_magnetometer(self, section: FilterSection) -> None:
        dts_s = np.full(600, 1.0 / RATE_HZ)
        headings = []
        for field in (FIELD_UT, FIELD_UT + [25.0, -20.0, 30.0]):
            filter_, truth = make(section), attitudes(NODES, 7)
            rest(filter_, truth, 200)
            before = filter_.q_inertial_from_sensor()
            end = move(filter_, truth, dts_s, field)
            # how far it turned in the world, beside the truth
            turned = multiply(filter_.q_inertial_from_sensor(), conjugate(before))
            frame = multiply(before, conjugate(truth))
            true_turn = multiply(multiply(frame, multiply(end, conjugate(truth))), conjugate(frame))
            headings.append(off_deg(turned, true_turn))
        assert max(headings) < (1.0 if isinstance(section, MahonyConfig) else 0.3)

    def test_six_axis_keeps_its_inclination_and_its_heading(self, section: FilterSection) -> None:
        filter_, truth = make(section), attitudes(NODES, 8)
        rest(filter_, truth, 1, NO_FIELD)
        start = filter_.q_world_from_sensor()
        assert inclination_deg(start, truth) < 0.1
        rest(filter_, truth, 100, NO_FIELD)
        end = move(filter_, truth, np.full(600, 1.0 / RATE_HZ), NO_FIELD)
        found = filter_.q_world_from_sensor()
        assert inclination_deg(found, end) < 0.2
        # by its own heading at the start
        assert off_deg(multiply(conjugate(start), found), multiply(conjugate(truth), end)) < 1.0
        assert np.allclose(filter_.q_inertial_from_sensor(), found, atol=1e-12)

    def test_a_magnetometer_that_falls_silent_leaves_the_others_alone(self, section: FilterSection) -> None:
        some, all_ = make(section), make(section)
        truth = attitudes(NODES, 9)
        rest(some, truth, 50)
        rest(all_, truth, 50)
        mag = seen(truth, FIELD_UT + [5.0, 0.0, 0.0])
        silent = mag.copy()
        silent[1] = np.nan
        for _ in range(100):
            some.update(rate_at(0.0), seen(truth, GRAVITY), silent)
            all_.update(rate_at(0.0), seen(truth, GRAVITY), mag)
        found, expected = some.q_world_from_sensor(), all_.q_world_from_sensor()
        assert np.all(np.isfinite(found))
        assert np.allclose(found[[0, 2]], expected[[0, 2]], atol=1e-12)

    def test_restart_forgets_all_of_a_node_and_nothing_of_the_others(self, section: FilterSection) -> None:
        filter_, alone, fresh = (make(section) for _ in range(3))
        dts_s = np.full(200, 1.0 / RATE_HZ)
        truth = move(filter_, attitudes(NODES, 10), dts_s)
        move(alone, attitudes(NODES, 10), dts_s)
        filter_.restart(np.array([True, False, False]))
        for each in (filter_, alone, fresh):
            move(each, truth, dts_s, start_s=1.0)
        for name in ("q_world_from_sensor", "q_inertial_from_sensor", "bias_rad_s"):
            restarted, other, new = (getattr(each, name)() for each in (filter_, alone, fresh))
            assert np.allclose(restarted[0], new[0], atol=1e-12)
            assert np.allclose(restarted[1:], other[1:], atol=1e-12)

    def test_what_it_hands_out_is_the_caller_s_own(self, section: FilterSection) -> None:
        filter_ = make(section)
        rest(filter_, attitudes(NODES), 2)
        for of in (filter_.q_world_from_sensor, filter_.q_inertial_from_sensor, filter_.bias_rad_s):
            before = of()
            of()[:] = 7.0
            assert np.array_equal(of(), before)
