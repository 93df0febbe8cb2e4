import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from common.quaternion import Array
from slave.guard import GuardConfig
from slave.track.blend import Course
from slave.track.continuation import Continuation
from slave.track.correction import Correction
from slave.track.estimate import Estimate, first
from slave.track.persistence import MOST_S, Persistence
from slave.track.predict import Predict

from .samples import MS, PERIOD, TRANSIT, course, feed

LAG_S, HORIZON_S, BLEND_S = 0.031, 0.3, 0.08


class Lasting(Persistence):
    """Of a movement whose τ is known."""

    def __init__(self, known_s: float) -> None:
        super().__init__()
        self._known_s = known_s

    @property
    def lasts_s(self) -> Array:
        return np.array(self._known_s)


def fresh() -> Predict:
    return Predict(BLEND_S, LAG_S, HORIZON_S)


def test_a_reset_forgets_the_difference_being_worked_off() -> None:
    tracker = fresh()
    feed(tracker, 0, 0.0, 0.0)
    feed(tracker, 1, 1.0, 0.0)
    tracker.reset()
    feed(tracker, 1, 5.0, 0.0)
    assert course(tracker, PERIOD + TRANSIT + 1)[0] == pytest.approx(5.0)


@pytest.mark.parametrize("speed", [-2.0, 0.0, 1.5])
def test_constant_velocity_is_followed_and_aimed_ahead(
    speed: float,
) -> None:
    tracker = fresh()
    for k in range(10):
        feed(tracker, k, speed * PERIOD * k / 1e3, speed)
        for ms in np.arange(PERIOD * k + TRANSIT, PERIOD * (k + 1) + TRANSIT, 5.0).tolist():
            position, velocity = course(tracker, ms)
            ahead_s = (ms - PERIOD * k) / 1e3 + LAG_S
            lead = float(position[0]) - speed * PERIOD * k / 1e3
            assert 0.75 * abs(speed) * ahead_s <= abs(lead) + 1e-9
            assert abs(lead) <= abs(speed) * ahead_s + 1e-9
            assert 0.75 * abs(speed) <= abs(float(velocity[0])) + 1e-9


def test_a_reach_like_the_one_before_is_followed_better_than_by_velocity_alone() -> None:
    tracker, by = fresh(), 1.0

    def reach(t_s: float) -> tuple[float, float]:
        """There in 1 s, a rest of 1 s, and back."""
        x = min(max(t_s, 0.0), 1.0) - min(max(t_s - 2.0, 0.0), 1.0)
        rate = 1.0 if 0.0 < t_s < 1.0 else -1.0 if 2.0 < t_s < 3.0 else 0.0
        return by * x**3 * (10 + x * (6 * x - 15)), rate * 30 * by * (x * (1 - x)) ** 2

    errors, plain = [], []
    for k in range(38):
        p, v = reach(PERIOD * k / 1e3)
        feed(tracker, k, p, v)
        for ms in range(PERIOD * k + TRANSIT, PERIOD * (k + 1) + TRANSIT, 5):
            ahead_s = (ms - PERIOD * k) / 1e3 + LAG_S
            true, _ = reach(ms / 1e3 + LAG_S)
            if k >= 25:
                errors.append(float(course(tracker, ms)[0][0]) - true)
                plain.append(p + v * ahead_s - true)
    assert np.std(errors) < 0.9 * np.std(plain)


jumps = st.lists(st.tuples(st.floats(-1.5, 1.5), st.floats(-4.0, 4.0)), min_size=2, max_size=8)


@settings(deadline=None)
@given(jumps, st.lists(st.integers(0, 60), min_size=8, max_size=8))
def test_no_sample_however_wild_makes_position_or_velocity_jump(
    samples: list[tuple[float, float]], transits: list[int]
) -> None:
    tracker = fresh()
    for k, (position, velocity) in enumerate(samples):
        at_ms = PERIOD * k + transits[k]
        before = tracker.target(at_ms * MS)
        feed(tracker, k, position, velocity, transits[k])
        after = tracker.target(at_ms * MS)
        assert after is not None
        if before is not None:
            np.testing.assert_allclose(after.position_rad, before.position_rad, atol=1e-9)
            np.testing.assert_allclose(after.velocity_rad_s, before.velocity_rad_s, atol=1e-8)


def test_the_velocity_is_the_slope_of_the_position() -> None:
    tracker = fresh()
    for k, (p, v) in enumerate([(0.0, 1.0), (0.2, -1.0), (0.1, 2.0)]):
        feed(tracker, k, p, v)
    for ms in np.arange(175.0, 600.0, 7.0).tolist():
        (before, _), (_, velocity), (after, _) = (course(tracker, ms + d) for d in (-0.01, 0.0, 0.01))
        assert (after - before) / 2e-5 == pytest.approx(velocity, abs=5e-3)


def test_without_samples_it_is_at_rest_from_the_horizon_on() -> None:
    tracker = fresh()
    feed(tracker, 0, 0.0, 2.0)
    rest_ms = 1e3 * (HORIZON_S - LAG_S)
    assert course(tracker, rest_ms - 20.0)[1] > 0.0
    stood, velocity = course(tracker, rest_ms)
    assert velocity == pytest.approx(0.0, abs=1e-9)
    # full rate for half of the horizon, then the mean of a smooth descent
    foretold = Continuation.of(first(0, np.zeros(1), np.full(1, 2.0)), Persistence().lasts_s)
    assert stood == pytest.approx(foretold.way(0.75 * HORIZON_S))
    assert course(tracker, 60_000.0)[0] == pytest.approx(stood)


@settings(deadline=None)
@given(
    st.floats(-60.0, 60.0),
    st.floats(-800.0, 800.0),
    st.floats(0.03, MOST_S),
    st.sampled_from([0.3, 0.5, 1.0]),
)
def test_no_joint_is_foretold_farther_than_the_guard_takes_for_a_jump(
    velocity: float, acceleration: float, lasts_s: float, horizon_s: float
) -> None:
    """Coasting included, for any τ, and also where velocity and acceleration cancel at the end."""
    tracker = Predict(BLEND_S, LAG_S, horizon_s)
    tracker._persistence = Lasting(lasts_s)
    motion = np.array([[1.0], [velocity], [acceleration]])
    tracker._believe(Estimate(0, motion, np.eye(3)), motion[1])
    farthest = max(abs(float(course(tracker, ms)[0][0]) - 1.0) for ms in range(0, 1200, 10))
    assert farthest <= 0.68 + 1e-9
    assert farthest < GuardConfig().jump_window_rad


@pytest.mark.parametrize("transit", [2, 30, 80, 150])
def test_the_horizon_follows_the_link_up_to_the_ceiling(transit: int) -> None:
    tracker = Predict(BLEND_S, LAG_S, 0.4)
    for k in range(40):
        feed(tracker, k, 0.01 * k, 0.125, transit)
    usual_s = max((PERIOD + transit) / 1e3 + LAG_S, 0.15)
    assert tracker.horizon_s == pytest.approx(min(usual_s, 0.25), abs=0.002)


def test_after_a_long_silence_the_estimate_restarts_without_a_jump() -> None:
    tracker = fresh()
    for k in range(4):
        feed(tracker, k, 0.1 * k, 0.1 / 0.08)
    stood, _ = course(tracker, 999.0)
    feed(tracker, 12, -1.0, 0.0)
    assert course(tracker, 12 * PERIOD + TRANSIT)[0] == pytest.approx(stood)
    # what is left of a difference fades
    settled = 12 * PERIOD + TRANSIT + 20e3 * BLEND_S
    # no memory of the old motion: all of the new position, none of the old acceleration
    assert course(tracker, settled)[0] == pytest.approx(-1.0)


def test_without_velocities_it_goes_by_the_positions() -> None:
    tracker = fresh()
    for k in range(8):
        feed(tracker, k, 1.0 * PERIOD * k / 1e3, 0.0)
    # steady motion is then met once the velocity is known from two samples and has been blended in
    position, velocity = course(tracker, 8 * PERIOD + TRANSIT - 1)
    assert velocity == pytest.approx(0.8, abs=0.1)
    assert position == pytest.approx((8 * PERIOD + TRANSIT - 1) / 1e3 + LAG_S, rel=0.05)


def test_the_same_samples_give_the_same_course_and_asking_changes_nothing() -> None:
    one, two = fresh(), fresh()
    for k in range(30):
        for tracker in (one, two):
            feed(tracker, k, np.sin(0.3 * k), np.cos(0.3 * k) * 3.75)
        for ms in range(5):
            one.target((PERIOD * k + TRANSIT + 40 * ms) * MS)
        at_ms = PERIOD * k + TRANSIT + 3
        np.testing.assert_array_equal(course(one, at_ms), course(two, at_ms))


def test_nothing_of_the_movement_is_kept_over_a_reset() -> None:
    used, new = fresh(), fresh()
    for k in range(30):
        feed(used, k, np.sin(2.0 * k), np.cos(2.0 * k) * 25.0)
    used.reset()
    for k in range(30, 40):
        for tracker in (used, new):
            feed(tracker, k, 0.05 * k, 0.6)
        at_ms = PERIOD * k + TRANSIT + 30
        np.testing.assert_array_equal(course(used, at_ms), course(new, at_ms))


def test_two_samples_at_nearly_one_instant_cause_no_acceleration() -> None:
    """A late master makes up for a missed tick, or a better offset moves a stamp next to the one before."""
    tracker = fresh()
    for k in range(5):
        feed(tracker, k, 0.0, 0.0)
    at_ms = PERIOD * 4
    tracker.accept(at_ms * MS + 1000, (at_ms + PERIOD) * MS, np.array([0.0]), np.array([0.1]))
    for ms in range(at_ms + PERIOD, at_ms + 3 * PERIOD, 5):
        position, velocity = course(tracker, ms)
        assert abs(position) < 0.1
        assert abs(velocity) < 2.0


def test_the_noise_of_a_still_operator_does_not_shake_the_robot() -> None:
    """0.05° and 0.4°/s of noise at rest: 268°/s² with the corrections of an even movement, 91 without."""
    draw = np.random.default_rng(1)
    accelerations = []
    tracker, velocity_before = fresh(), 0.0
    for k in range(200):
        feed(tracker, k, np.radians(0.05) * draw.normal(), np.radians(0.4) * draw.normal())
        for ms in np.arange(PERIOD * k + TRANSIT, PERIOD * (k + 1) + TRANSIT, 5.0).tolist():
            velocity = float(course(tracker, ms)[1][0])
            accelerations.append((velocity - velocity_before) / 0.005)
            velocity_before = velocity
    assert np.degrees(np.std(accelerations[400:])) < 150.0


def test_a_command_out_of_turn_is_corrected_no_faster_than_one_in_turn(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The master sends one as it names a node: by the time since the last, it would decay at 40 a second."""
    decays: list[float] = []
    begin = Correction.begin

    def noted(self: Correction, now_ns: int, old: Course, new: Course, decay: float, even: Array) -> None:
        decays.append(decay)
        begin(self, now_ns, old, new, decay, even)

    monkeypatch.setattr(Correction, "begin", noted)
    tracker = fresh()
    for k in range(10):
        feed(tracker, k, 0.1 * k, 1.25)
    tracker.accept(
        (9 * PERIOD + 15) * MS, (9 * PERIOD + 15 + TRANSIT) * MS, np.array([0.92]), np.array([1.25])
    )
    feed(tracker, 10, 1.0, 1.25)
    assert decays == pytest.approx([1.8 / BLEND_S] * 11)
