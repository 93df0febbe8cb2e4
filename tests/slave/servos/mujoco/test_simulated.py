import numpy as np
import pytest

from common.skeleton import load_skeleton
from slave.encoders.counts import RAD_PER_COUNT, EncoderConfig, Encoders
from slave.servos.mujoco.simulated import CYCLE_NS, MOST_CYCLES, SimulatedRobot
from slave.track.config import SERVO_LAG_S

SKELETON = load_skeleton("nursing")
J = len(SKELETON.joints)
MIDDLE = 0.5 * (SKELETON.lower_rad + SKELETON.upper_rad)
MS = 1_000_000


def advanced(robot: SimulatedRobot, ms: float) -> SimulatedRobot:
    end_ns = robot.now_ns + round(ms * MS)
    while robot.now_ns + CYCLE_NS <= end_ns:
        robot.advance(robot.now_ns + CYCLE_NS)
    return robot


def test_it_starts_at_rest_as_near_zero_as_the_limits_let_it() -> None:
    robot = advanced(SimulatedRobot(SKELETON), 200)
    neutral = np.clip(0.0, SKELETON.lower_rad, SKELETON.upper_rad)
    assert np.abs(robot.position_rad - neutral).max() < np.deg2rad(0.3)


def test_advance_runs_whole_cycles_and_never_past_the_time_asked() -> None:
    robot = SimulatedRobot(SKELETON, origin_ns=7)
    robot.advance(7 + CYCLE_NS - 1)
    assert robot.now_ns == robot.read().read_ns == 7
    robot.advance(7 + 2 * CYCLE_NS + 1)
    assert robot.now_ns == robot.read().read_ns == 7 + 2 * CYCLE_NS
    robot.advance(0)
    assert robot.now_ns == 7 + 2 * CYCLE_NS


def test_a_setpoint_takes_effect_at_the_end_of_its_cycle() -> None:
    robot, idle = SimulatedRobot(SKELETON, position_rad=MIDDLE), SimulatedRobot(SKELETON, position_rad=MIDDLE)
    robot.write(MIDDLE + 0.1)
    for r in (robot, idle):
        advanced(r, 4)
    np.testing.assert_array_equal(robot.position_rad, idle.position_rad)
    for r in (robot, idle):
        advanced(r, 4)
    assert (robot.position_rad > idle.position_rad).all()


def test_without_writes_the_drives_hold() -> None:
    robot = SimulatedRobot(SKELETON, position_rad=MIDDLE)
    robot.write(MIDDLE + 0.1)
    advanced(robot, 3_000)
    assert np.abs(robot.position_rad - (MIDDLE + 0.1)).max() < np.deg2rad(0.3)


def test_a_late_advance_catches_up_a_little_and_skips_the_rest() -> None:
    robot, punctual = (SimulatedRobot(SKELETON, position_rad=MIDDLE) for _ in range(2))
    for r in (robot, punctual):
        r.write(MIDDLE + 0.1)
        r.advance(CYCLE_NS)
    robot.advance((1 + MOST_CYCLES) * CYCLE_NS)
    assert robot.skipped_cycles == 0
    late = SimulatedRobot(SKELETON, position_rad=MIDDLE)
    late.write(MIDDLE + 0.1)
    late.advance(CYCLE_NS)
    late.advance((1 + MOST_CYCLES + 3) * CYCLE_NS)
    assert late.skipped_cycles == 3
    assert late.now_ns == (1 + MOST_CYCLES + 3) * CYCLE_NS
    # skipped time is time in which the robot did not move
    np.testing.assert_array_equal(late.position_rad, robot.position_rad)


def test_the_same_writes_give_the_same_counts() -> None:
    def counts() -> list[list[int]]:
        robot, seen = SimulatedRobot(SKELETON), []
        for k in range(100):
            robot.write(MIDDLE + 0.2 * np.sin(0.1 * k))
            seen.append(advanced(robot, 5).read().counts.tolist())
        return seen

    assert counts() == counts()


def test_counts_are_what_the_mounting_makes_of_the_true_angles() -> None:
    mounting = EncoderConfig(
        zero_counts=dict.fromkeys(SKELETON.joint_names, 4000), reversed=["left_elbow_pitch", "neck_yaw"]
    )
    robot = SimulatedRobot(SKELETON, mounting, position_rad=HIGH)
    reading = advanced(robot, 100).read()
    assert reading.valid.all()
    assert 0 <= reading.counts.min() <= reading.counts.max() <= 4095
    measured = Encoders(SKELETON, mounting).position_rad(reading.counts)
    assert np.abs(measured - robot.position_rad).max() <= 0.5 * RAD_PER_COUNT + 1e-12


HIGH = MIDDLE + 0.3 * (SKELETON.upper_rad - SKELETON.lower_rad)


def test_setpoints_beyond_the_limits_stop_at_them() -> None:
    robot = SimulatedRobot(SKELETON, position_rad=MIDDLE)
    robot.write(np.full(J, 10.0))
    advanced(robot, 1_500)
    assert np.abs(robot.position_rad - SKELETON.upper_rad).max() < np.deg2rad(0.3)


@pytest.mark.parametrize("bad", [np.full(J, np.nan), np.full(J, np.inf), np.zeros(J - 1)])
def test_setpoints_that_are_none_are_refused_and_change_nothing(bad: np.ndarray) -> None:
    robot = SimulatedRobot(SKELETON, position_rad=MIDDLE)
    with pytest.raises(ValueError, match="25 finite angles"):
        robot.write(bad)
    assert np.abs(advanced(robot, 100).position_rad - MIDDLE).max() < np.deg2rad(0.3)


def test_a_simulation_that_has_diverged_says_that_no_encoder_is_valid() -> None:
    robot = SimulatedRobot(SKELETON)
    robot._hinge_rad[3] = np.nan
    reading = robot.read()
    assert not reading.valid.any()
    assert reading.counts.shape == (J,)


def test_predict_aims_ahead_by_this_robot_s_lag_at_200_hz() -> None:
    robot = SimulatedRobot(SKELETON, position_rad=MIDDLE)
    speed = np.deg2rad(20.0)
    lags = []
    for k in range(100):
        now_ns = 5 * k * MS
        robot.advance(now_ns)
        robot.write(MIDDLE + speed * now_ns / 1e9)
        if k >= 60:
            lags.append(robot.now_ns / 1e9 - (robot.position_rad - MIDDLE) / speed)
    lag_s = np.mean(lags, axis=0)
    # joints move one another a little; over all of them that is nothing
    assert np.median(lag_s) == pytest.approx(SERVO_LAG_S, abs=0.001)
    assert np.abs(lag_s - SERVO_LAG_S).max() < 0.006
