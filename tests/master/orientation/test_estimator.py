from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from common.errors import ConfigError
from common.quaternion import (
    Array,
    angle_between,
    conjugate,
    from_rotation_vector,
    heading_turn,
    multiply,
    rotate,
    to_rotation_vector,
)
from common.skeleton import load_skeleton
from common.skeleton.kinematics import orientations, origins
from master.joint_angles.decomposition import JointAngles
from master.orientation.affine import Calibration, identity
from master.orientation.config import EstimationConfig
from master.orientation.estimator import Estimator

from .perfect import FIELD_UT, GRAVITY, RATE_HZ, Node, Readings, attitudes, seen_by

QUICK = EstimationConfig(settle_s=0.1)
SETTLE_TICKS = 20


def estimator(
    count: int, config: EstimationConfig = QUICK, calibration: Calibration | None = None
) -> Estimator:
    return Estimator(config, [Node()] * count, RATE_HZ, calibration or identity(count))


def rest(estimator_: Estimator, truth: Array, ticks: int, **changes: Any) -> None:
    readings = replace(seen_by(truth, np.zeros((len(truth), 3))), **changes)
    for _ in range(ticks):
        estimator_.update(readings)


class Turning:
    """Sensors that swing, with their true orientation at each tick."""

    def __init__(self, count: int, seed: int = 0, amplitude_rad_s: float = 3.0) -> None:
        rng = np.random.default_rng(seed)
        self.q = attitudes(count, seed)
        self._phase, self._speed = rng.uniform(0.0, 6.0, (count, 3)), rng.uniform(2.0, 6.0, (count, 3))
        self._amplitude, self._tick = amplitude_rad_s, 0

    def rate_at(self, tick: float) -> Array:
        return self._amplitude * np.sin(self._speed * tick / RATE_HZ + self._phase)

    def readings(self) -> Readings:
        """Moves on by one tick."""
        steps = 8
        for step in range(steps):
            middle = self.rate_at(self._tick + (step + 0.5) / steps)
            self.q = multiply(self.q, from_rotation_vector(middle / (steps * RATE_HZ)))
        self._tick += 1
        return seen_by(self.q, self.rate_at(self._tick))


def test_perfect_sensors_give_a_person_s_joints_back() -> None:
    skeleton = load_skeleton("nursing")
    node_m = np.array([segment.node_m for segment in skeleton.segments])
    middle = 0.5 * (skeleton.lower_rad + skeleton.upper_rad)
    reach = 0.35 * (skeleton.upper_rad - skeleton.lower_rad)
    rng = np.random.default_rng(0)
    speed, phase = rng.uniform(1.5, 4.0, len(middle)), rng.uniform(0.0, 6.0, len(middle))

    def pose(t_s: Array) -> Array:
        start = np.clip((t_s - 1.0) / 2.0, 0.0, 1.0)[:, None]
        smooth = start**3 * (10.0 - 15.0 * start + 6.0 * start**2)
        return smooth * (middle + reach * np.sin(t_s[:, None] * speed + phase))

    t_s, h = np.arange(1600) / RATE_HZ, 1e-3
    q_before, q, q_after = (orientations(skeleton, pose(t_s + shift), 0.4) for shift in (-h, 0.0, h))
    places = [origins(skeleton, each) + rotate(each, node_m) for each in (q_before, q, q_after)]
    acc = (places[0] - 2.0 * places[1] + places[2]) / h**2 + GRAVITY
    rate = to_rotation_vector(multiply(conjugate(q_before), q_after)) / (2.0 * h)
    velocity = (pose(t_s + h) - pose(t_s - h)) / (2.0 * h)
    subject, solver = estimator(len(node_m)), JointAngles(skeleton)
    errors, velocity_errors = [], []
    for tick in range(len(t_s)):
        subject.update(seen_by(q[tick], rate[tick], acc[tick]))
        if tick > 800 and tick % 16 == 0:
            posture = subject.posture()
            assert posture.valid.all()
            position_now, velocity_now = solver.solve(posture.q_world_from_segment, posture.rate_rad_s)
            errors.append(np.degrees(position_now - pose(t_s[tick : tick + 1])[0]))
            velocity_errors.append(velocity_now - velocity[tick])
    assert np.mean(np.abs(errors)) < 0.15
    assert np.max(np.abs(errors)) < 1.0
    # the rates are of the same instant: 3.5 ms, the gyro low-pass's delay, would give 0.017
    assert np.sqrt(np.mean(np.square(velocity_errors))) < 0.008 * np.sqrt(np.mean(np.square(velocity)))


@pytest.mark.parametrize("cutoff_hz", [0.0, 50.0, 15.0])
@pytest.mark.parametrize("name", ["vqf", "mahony"])
def test_the_gyro_low_pass_s_delay_is_made_good(cutoff_hz: float, name: str) -> None:
    cutoffs = {f"{s}_cutoff_hz": cutoff_hz for s in ("accelerometer", "gyroscope", "magnetometer")}
    subject = estimator(6, EstimationConfig.model_validate({"filter": name, "settle_s": 0.1, **cutoffs}))
    turning = Turning(6, amplitude_rad_s=2.0)
    along = []
    for tick in range(800):
        readings = turning.readings()
        subject.update(readings)
        if tick > 200:
            error = to_rotation_vector(multiply(conjugate(turning.q), subject.posture().q_world_from_segment))
            along.append((error * readings.gyr_rad_s, readings.gyr_rad_s**2))
    lag_s = -np.sum([e for e, _ in along]) / np.sum([r for _, r in along])
    # uncorrected it is 2.5 ms early without a low-pass, and 2 ms late at 50 Hz, 12 ms at 15 Hz
    assert abs(lag_s) < 0.25 / RATE_HZ


def test_a_node_is_valid_once_it_has_settled() -> None:
    subject, truth = estimator(2), attitudes(2)
    rest(subject, truth, SETTLE_TICKS)
    assert not subject.posture().valid.any()
    rest(subject, truth, 1)
    assert subject.posture().valid.all()
    assert np.max(angle_between(subject.posture().q_world_from_segment, truth)) < np.radians(0.5)


def test_a_late_node_goes_on_at_the_rate_last_heard() -> None:
    truth = np.tile([1.0, 0.0, 0.0, 0.0], (2, 1))
    subject = estimator(2)
    rest(subject, truth, 200)
    spin = np.tile([0.0, 0.0, 1.0], (2, 1))
    late, held = np.array([[False], [True]]), seen_by(truth, spin)
    for tick in range(20):
        truth = multiply(truth, from_rotation_vector(spin / RATE_HZ))
        now = seen_by(truth, spin)
        if tick < 10:
            held = now
        # the poll repeats what it last had
        readings = Readings(
            acc_m_s2=np.where(late, held.acc_m_s2, now.acc_m_s2),
            gyr_rad_s=np.where(late, held.gyr_rad_s, now.gyr_rad_s),
            mag_ut=np.where(late, held.mag_ut, now.mag_ut),
            fresh=~late[:, 0] | (tick < 10),
            lost=now.lost,
        )
        subject.update(readings)
    posture = subject.posture()
    assert posture.valid.all()
    assert np.max(angle_between(posture.q_world_from_segment, truth)) < np.radians(0.5)


def test_a_lost_node_is_invalid_and_its_neighbours_do_not_notice() -> None:
    alone, turning = estimator(3), Turning(3)
    beside, twin = estimator(3), Turning(3)
    lost = np.array([False, True, False])
    for tick in range(120):
        alone.update(turning.readings())
        readings = twin.readings()
        beside.update(replace(readings, fresh=~lost, lost=lost) if tick >= 60 else readings)
        if tick in (59, 60):
            assert beside.posture().valid.tolist() == [True, tick == 59, True]
    expected, found = alone.posture(), beside.posture()
    assert np.array_equal(found.q_world_from_segment[~lost], expected.q_world_from_segment[~lost])
    assert np.array_equal(found.rate_rad_s[~lost], expected.rate_rad_s[~lost])


def test_a_lost_node_rests_and_does_not_spin_on() -> None:
    subject, turning = estimator(1), Turning(1)
    for _ in range(60):
        readings = turning.readings()
        subject.update(readings)
    gone = replace(readings, fresh=np.array([False]), lost=np.array([True]))
    for _ in range(50):
        subject.update(gone)
    assert np.linalg.norm(subject.posture().rate_rad_s) < 0.2


def test_a_node_that_returns_starts_anew_and_settles_first() -> None:
    subject = estimator(2)
    before, after = attitudes(2, 1), attitudes(2, 2)
    lost = np.array([False, True])
    rest(subject, before, 60)
    rest(subject, before, 10, fresh=~lost, lost=lost)
    moved = np.where(lost[:, None], after, before)
    rest(subject, moved, SETTLE_TICKS)
    assert subject.posture().valid.tolist() == [True, False]
    rest(subject, moved, 1)
    posture = subject.posture()
    assert posture.valid.all()
    # not dragged from where it was: the old filter would need seconds
    assert np.max(angle_between(posture.q_world_from_segment, moved)) < np.radians(0.5)


@pytest.mark.parametrize("name", ["vqf", "mahony"])
def test_without_a_magnetometer_a_returning_node_keeps_its_heading(name: str) -> None:
    subject = estimator(2, EstimationConfig.model_validate({"filter": name, "settle_s": 0.1}))
    no_field = np.full((2, 3), np.nan)
    spin = np.tile([0.0, 0.0, 1.0], (2, 1))
    truth = np.tile([1.0, 0.0, 0.0, 0.0], (2, 1))
    rest(subject, truth, 40, mag_ut=no_field)
    for _ in range(200):
        truth = multiply(truth, from_rotation_vector(spin / RATE_HZ))
        subject.update(replace(seen_by(truth, spin), mag_ut=no_field))
    lost = np.array([False, True])
    rest(subject, truth, 5, mag_ut=no_field, fresh=~lost, lost=lost)
    # back for less than it takes to settle, which tells nothing
    rest(subject, truth, SETTLE_TICKS // 2, mag_ut=no_field)
    rest(subject, truth, 5, mag_ut=no_field, fresh=~lost, lost=lost)
    leaning = multiply(truth, from_rotation_vector(np.array([[0.0, 0.0, 0.0], [0.3, 0.0, 0.0]])))
    rest(subject, np.where(lost[:, None], leaning, truth), SETTLE_TICKS + 1, mag_ut=no_field)
    posture = subject.posture()
    assert posture.valid.all()
    assert angle_between(posture.q_world_from_segment, leaning)[1] < np.radians(3.0)


def test_a_node_never_heard_gives_finite_numbers_and_is_invalid() -> None:
    subject = estimator(2)
    silent = np.array([False, True])
    rest(
        subject,
        attitudes(2),
        60,
        acc_m_s2=np.where(silent[:, None], 0.0, rotate(conjugate(attitudes(2)), np.tile(GRAVITY, (2, 1)))),
        mag_ut=np.where(silent[:, None], np.nan, rotate(conjugate(attitudes(2)), np.tile(FIELD_UT, (2, 1)))),
        fresh=~silent,
        lost=silent,
    )
    posture = subject.posture()
    assert posture.valid.tolist() == [True, False]
    assert np.all(np.isfinite(posture.q_world_from_segment))
    assert np.all(np.isfinite(posture.rate_rad_s))


def test_a_missing_magnetometer_leaves_the_other_nodes_alone() -> None:
    whole, partly, turning, twin = estimator(3), estimator(3), Turning(3), Turning(3)
    for _ in range(80):
        whole.update(turning.readings())
        readings = twin.readings()
        mag = readings.mag_ut.copy()
        mag[0] = np.nan
        partly.update(replace(readings, mag_ut=mag))
    expected, found = whole.posture(), partly.posture()
    assert np.array_equal(found.q_world_from_segment[1:], expected.q_world_from_segment[1:])
    assert np.all(np.isfinite(found.q_world_from_segment))
    assert found.valid.all()


def test_an_alignment_gives_the_segment_s_posture_and_rate() -> None:
    alignment = attitudes(4, 9)
    askew = estimator(4, QUICK, replace(identity(4), q_sensor_from_segment=alignment))
    turning = Turning(4)
    for _ in range(200):
        readings = turning.readings()
        askew.update(readings)
    posture = askew.posture()
    segment = multiply(turning.q, alignment)
    assert np.max(angle_between(posture.q_world_from_segment, segment)) < np.radians(1.0)
    assert np.allclose(posture.rate_rad_s, rotate(conjugate(alignment), readings.gyr_rad_s), atol=0.15)


def test_readings_are_calibrated_before_all_else() -> None:
    calibration = identity(1)
    calibration.affine[1, 0, :, 3] = [0.3, -0.2, 0.1]
    subject, truth = estimator(1, QUICK, calibration), attitudes(1)
    rest(subject, truth, 100, gyr_rad_s=np.array([[-0.3, 0.2, -0.1]]))
    assert np.max(angle_between(subject.posture().q_world_from_segment, truth)) < np.radians(0.1)
    assert np.allclose(subject.posture().rate_rad_s, 0.0, atol=1e-3)


def test_the_gyro_s_bias_that_the_filter_learns_is_no_motion() -> None:
    subject, truth = estimator(1), attitudes(1)
    rest(subject, truth, 1600, gyr_rad_s=np.array([[0.01, -0.01, 0.005]]))
    assert np.allclose(subject.posture().rate_rad_s, 0.0, atol=1e-3)


def test_calibrations_are_read_from_the_files_that_the_nodes_name(tmp_path: Path) -> None:
    path = tmp_path / "node.toml"
    path.write_text("q_sensor_from_segment = [0, 1, 0, 0]")
    subject = Estimator(QUICK, [Node(), Node(calibration=path)], RATE_HZ)
    rest(subject, np.tile([1.0, 0.0, 0.0, 0.0], (2, 1)), 60)
    turned = angle_between(np.array([1.0, 0.0, 0.0, 0.0]), subject.posture().q_world_from_segment)
    assert np.allclose(turned, [0.0, np.pi], atol=0.01)


def test_a_zero_pose_zeroes_sensors_worn_askew() -> None:
    config = EstimationConfig(settle_s=0.1, zero_pose_s=0.5, zero_pose_heading_deg=40.0)
    alignment, facing = attitudes(5, 3), np.radians(40.0)
    subject = estimator(5, config)
    standing = multiply(heading_turn(np.full(5, facing)), conjugate(alignment))
    rest(subject, standing, SETTLE_TICKS + 99)
    assert not subject.posture().valid.any()
    rest(subject, standing, 1)
    assert subject.posture().valid.all()
    q = heading_turn(np.full(5, facing))
    rate = np.random.default_rng(4).normal(size=(5, 3))
    for _ in range(100):
        q = multiply(q, from_rotation_vector(rate / RATE_HZ))
        subject.update(seen_by(multiply(q, conjugate(alignment)), rotate(alignment, rate)))
    posture = subject.posture()
    assert np.max(angle_between(posture.q_world_from_segment, q)) < np.radians(1.0)
    assert np.allclose(posture.rate_rad_s, rate, atol=0.05)


def test_each_node_may_have_its_own_filter() -> None:
    mixed = Estimator(QUICK, [Node("mahony"), Node(), Node("vqf")], RATE_HZ, identity(3))
    pure = {name: estimator(3, EstimationConfig(filter=name, settle_s=0.1)) for name in ("vqf", "mahony")}
    turning = Turning(3)
    for _ in range(100):
        readings = turning.readings()
        for each in (mixed, *pure.values()):
            each.update(readings)
    q = mixed.posture().q_world_from_segment
    assert np.allclose(q[0], pure["mahony"].posture().q_world_from_segment[0], atol=1e-12)
    assert np.allclose(q[1:], pure["vqf"].posture().q_world_from_segment[1:], atol=1e-12)


def test_a_cutoff_must_lie_below_half_the_rate() -> None:
    config = EstimationConfig(gyroscope_cutoff_hz=99.9, accelerometer_cutoff_hz=100.0)
    (mistake,) = config.mistakes_at(RATE_HZ)
    assert mistake.key == "estimation.accelerometer_cutoff_hz"
    assert mistake.value == 100.0
    assert mistake.expected == "less than half the rate of 200 Hz, or 0"
    with pytest.raises(ConfigError, match=r"estimation\.accelerometer_cutoff_hz = 100\.0"):
        Estimator(config, [Node()], RATE_HZ, identity(1))


def test_a_zero_pose_with_constraints_gives_headings_without_a_field() -> None:
    config = EstimationConfig(settle_s=0.1, zero_pose_s=0.2, zero_pose_heading_deg=40.0, constraints="online")
    alignment = attitudes(7, 5)
    calibration = replace(identity(7), q_sensor_from_segment=alignment)
    subject = Estimator(config, [Node()] * 7, RATE_HZ, calibration, load_skeleton("lower_limb"))
    facing = heading_turn(np.full(7, np.radians(40.0)))
    rest(subject, multiply(facing, conjugate(alignment)), 80, mag_ut=np.full((7, 3), np.nan))
    posture = subject.posture()
    assert posture.valid.all()
    assert np.max(angle_between(posture.q_world_from_segment, facing)) < np.radians(0.5)
