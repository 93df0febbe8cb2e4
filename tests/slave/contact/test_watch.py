"""When the robot counts as pushed, when no longer, and when nobody can know."""

from __future__ import annotations

import numpy as np
import pytest

from common.quaternion import Array
from common.skeleton import load_skeleton
from slave.contact.config import ContactConfig, ContactJoint
from slave.contact.watch import ContactWatch
from slave.encoders.counts import Encoders
from slave.servos.servos import EncoderReading

SKELETON = load_skeleton("nursing")
NAMES = SKELETON.joint_names
ELBOW = NAMES.index("left_elbow_pitch")
CYCLE_NS = 5_000_000
STILL_RAD = np.clip(np.zeros(25), SKELETON.lower_rad, SKELETON.upper_rad)


class Standing:
    """A robot that stands still, held by torques that may be other than what the model asks for."""

    def __init__(self, config: ContactConfig | None = None, stand_rad: Array = STILL_RAD) -> None:
        self.watch = ContactWatch(SKELETON, config or ContactConfig())
        self.stand_rad = stand_rad
        self.encoders = Encoders(SKELETON)
        self.now_ns = 0
        self.needed_nm = np.zeros(25)
        self.run(1)
        self.run(200)
        self.needed_nm = -self.watch.observer.external_nm.copy()
        self.run(100)

    def run(self, ticks: int, pushed_nm: Array | None = None, effort_nm: Array | None = None) -> None:
        for _ in range(ticks):
            self.now_ns += CYCLE_NS
            effort = self.needed_nm - (0.0 if pushed_nm is None else pushed_nm)
            reading = EncoderReading(
                self.now_ns,
                self.encoders.counts(self.stand_rad),
                np.ones(25, np.bool_),
                effort_nm=effort if effort_nm is None else effort_nm,
            )
            self.watch.look(self.now_ns, reading, self.encoders.position_rad(reading.counts))


def push(share: float, watch: ContactWatch) -> Array:
    out = np.zeros(25)
    out[ELBOW] = share * watch.least_threshold_nm[ELBOW]
    return out


def test_at_the_threshold() -> None:
    robot = Standing()
    robot.run(200, push(0.95, robot.watch))
    assert robot.watch.finding is None
    robot.run(200, push(1.1, robot.watch))
    assert robot.watch.finding is not None
    assert "left_forearm" in robot.watch.finding
    assert "left_elbow_pitch" in robot.watch.finding
    assert robot.watch.count == 1


def test_it_lasts_until_it_is_well_below() -> None:
    robot = Standing()
    robot.run(200, push(1.5, robot.watch))
    robot.run(200, push(0.7, robot.watch))
    assert robot.watch.finding is not None
    robot.run(200, push(0.5, robot.watch))
    assert robot.watch.finding is None
    robot.run(200, push(1.5, robot.watch))
    assert robot.watch.count == 2


def test_a_written_threshold_counts() -> None:
    config = ContactConfig(joints={"left_elbow_pitch": ContactJoint(threshold_nm=20.0)}, model_error=0.0)
    robot = Standing(config)
    pushed = np.zeros(25)
    pushed[ELBOW] = 19.0
    robot.run(200, pushed)
    assert robot.watch.finding is None
    pushed[ELBOW] = 21.0
    robot.run(200, pushed)
    assert robot.watch.finding is not None


def test_fingers_are_meant_to_touch() -> None:
    robot = Standing()
    pushed = np.zeros(25)
    pushed[NAMES.index("left_index")] = 1.0
    robot.run(200, pushed)
    assert robot.watch.finding is None


@pytest.mark.parametrize("required", [True, False])
def test_drives_that_tell_no_torque_are_said(required: bool) -> None:
    robot = Standing(ContactConfig(required=required))
    assert robot.watch.missing(robot.now_ns) == ""
    assert robot.watch.fault(robot.now_ns) is None
    effort = robot.needed_nm.copy()
    effort[ELBOW] = np.nan
    robot.run(1, effort_nm=effort)
    words = robot.watch.missing(robot.now_ns)
    assert words == "no contact detection at left_elbow_pitch: the drives tell no torque"
    assert robot.watch.fault(robot.now_ns) == (words if required else None)
    external = robot.watch.external_nm
    assert external is not None
    assert np.isnan(external[ELBOW])
    assert np.isfinite(np.delete(external, ELBOW)).all()


def test_all_drives_without_torque() -> None:
    robot = Standing()
    robot.run(1, effort_nm=np.full(25, np.nan))
    assert robot.watch.missing(robot.now_ns) == "no contact detection: the drives tell no torque"
    assert robot.watch.external_nm is None


def test_a_torque_that_comes_back_is_watched_again() -> None:
    robot = Standing()
    robot.run(10, effort_nm=np.full(25, np.nan))
    robot.run(200)
    assert robot.watch.missing(robot.now_ns) == ""
    assert robot.watch.finding is None
    robot.run(200, push(1.5, robot.watch))
    assert robot.watch.finding is not None


def test_one_angle_that_leaps_is_left_out() -> None:
    robot = Standing()
    counts = robot.encoders.counts(STILL_RAD)
    counts[ELBOW] = (counts[ELBOW] + 300) % 4096
    robot.now_ns += CYCLE_NS
    reading = EncoderReading(robot.now_ns, counts, np.ones(25, np.bool_), effort_nm=robot.needed_nm)
    robot.watch.look(robot.now_ns, reading, robot.encoders.position_rad(counts))
    robot.run(50)
    assert robot.watch.count == 0
    assert robot.watch.observer.ready


def test_after_a_gap_a_hard_push_is_noticed_before_the_longer_time_constant_has_settled() -> None:
    robot = Standing()
    robot.now_ns += 30_000_000
    robot.run(32, push(4.0, robot.watch))
    assert not robot.watch.observer.ready
    assert robot.watch.finding is not None


def test_after_a_gap_a_contact_lasts_until_every_time_constant_has_settled() -> None:
    robot = Standing()
    robot.run(200, push(1.5, robot.watch))
    robot.now_ns += 30_000_000
    robot.run(40)
    assert robot.watch.observer.settled == 1
    assert robot.watch.finding is not None
    robot.run(40)
    assert robot.watch.finding is None


def test_a_threshold_that_is_no_number_is_no_detection_and_does_not_stay() -> None:
    robot, nowhere = Standing(ContactConfig(required=True)), np.full(25, np.nan)
    for _ in range(2):
        robot.watch.wrote(0.005, nowhere, nowhere)
    robot.run(120, push(5.0, robot.watch))
    assert "no contact detection" in robot.watch.missing(robot.now_ns)
    assert robot.watch.fault(robot.now_ns) is not None
    for _ in range(2):
        robot.watch.wrote(0.005, STILL_RAD, STILL_RAD)
    robot.run(120)
    assert robot.watch.missing(robot.now_ns) == ""
    robot.run(100, push(1.5, robot.watch))
    assert robot.watch.finding is not None


def test_angles_that_stay_away_are_no_detection() -> None:
    robot = Standing()
    for _ in range(150):
        robot.now_ns += CYCLE_NS
        reading = EncoderReading(
            robot.now_ns, robot.encoders.counts(STILL_RAD), np.zeros(25, np.bool_), effort_nm=robot.needed_nm
        )
        robot.watch.look(robot.now_ns, reading, STILL_RAD)
    assert "too late or leap" in robot.watch.missing(robot.now_ns)


def test_the_drives_own_angles_are_finer() -> None:
    robot = Standing()
    coarse_nm = robot.watch.floor_nm[ELBOW]
    robot.now_ns += CYCLE_NS
    reading = EncoderReading(
        robot.now_ns,
        robot.encoders.counts(STILL_RAD),
        np.ones(25, np.bool_),
        drive_rad=STILL_RAD,
        effort_nm=robot.needed_nm,
    )
    robot.watch.look(robot.now_ns, reading, STILL_RAD)
    assert robot.watch.floor_nm[ELBOW] < 0.5 * coarse_nm


def test_a_mixture_whose_joints_do_not_all_have_a_drive_s_angle_is_watched() -> None:
    """One angle that is not a number would make every joint's residual none, and nobody would be told."""
    robot = Standing()
    drive_rad = STILL_RAD.copy()
    drive_rad[NAMES.index("left_index")] = np.nan
    for share in (0.9, 1.3):
        pushed = push(share, robot.watch)
        for _ in range(200):
            robot.now_ns += CYCLE_NS
            counts = robot.encoders.counts(STILL_RAD)
            reading = EncoderReading(
                robot.now_ns, counts, np.ones(25, np.bool_), drive_rad, robot.needed_nm - pushed
            )
            robot.watch.look(robot.now_ns, reading, robot.encoders.position_rad(counts))
        assert robot.watch.missing(robot.now_ns) == ""
        assert (robot.watch.finding is not None) is (share > 1.0)


ROLL = NAMES.index("right_elbow_roll")


def standing_at(roll_rad: float) -> Standing:
    stand_rad = STILL_RAD.copy()
    stand_rad[ROLL] = roll_rad
    return Standing(stand_rad=stand_rad)


def rolled(robot: Standing, thresholds: float, ticks: int = 200) -> str | None:
    """What is found once somebody turns the forearm with so many thresholds."""
    pushed = np.zeros(25)
    pushed[ROLL] = thresholds * robot.watch.least_threshold_nm[ROLL]
    robot.run(ticks, pushed)
    return robot.watch.finding


def moved_to(robot: Standing, roll_rad: float) -> None:
    robot.stand_rad = robot.stand_rad.copy()
    robot.stand_rad[ROLL] = roll_rad


ENDS = [(SKELETON.lower_rad, 1.0), (SKELETON.upper_rad, -1.0)]
"""Limits, and the direction in which a stop pushes there."""


@pytest.mark.parametrize(("end_rad", "inwards"), ENDS)
def test_an_end_stop_that_a_joint_presses_into_is_nobody(end_rad: Array, inwards: float) -> None:
    """It pushes back a hundred times harder than any threshold."""
    robot = standing_at(float(end_rad[ROLL]) - 0.02 * inwards)
    assert rolled(robot, 100.0 * inwards) is None
    # who pushes it still once it has left its stop is noticed
    moved_to(robot, float(end_rad[ROLL]) + 0.02 * inwards)
    assert rolled(robot, 1.2 * inwards) is not None
    # and so is who pushes it further into the stop
    assert rolled(standing_at(float(end_rad[ROLL]) - 0.02 * inwards), -1.2 * inwards) is not None


@pytest.mark.parametrize(("end_rad", "inwards"), ENDS)
def test_a_joint_that_rests_at_its_limit_notices_a_push_both_ways(end_rad: Array, inwards: float) -> None:
    for way in (1.2 * inwards, -1.2 * inwards):
        assert rolled(standing_at(float(end_rad[ROLL])), way) is not None


@pytest.mark.parametrize(("end_rad", "inwards"), ENDS)
@pytest.mark.parametrize(("away_rad", "noticed"), [(0.0, False), (0.05, True)])
def test_a_rigid_stop_that_a_joint_hits_is_nobody(
    end_rad: Array, inwards: float, away_rad: float, noticed: bool
) -> None:
    """At 8 rad/s. Who stops a joint 3 degrees before it is noticed."""
    end = float(end_rad[ROLL]) + away_rad * inwards
    robot = standing_at(end + 1.6 * inwards)
    # it begins to move as if it had been moving always
    robot.watch.observer.restart()
    for k in range(40):
        moved_to(robot, end + (1.56 - 0.04 * k) * inwards)
        robot.run(1, np.zeros(25))
        if k == 30:
            robot.watch.finding = None
    robot.run(6, np.zeros(25))
    assert (robot.watch.finding is not None) is noticed
    if not noticed:
        assert rolled(robot, 1.5 * inwards, ticks=100) is not None, "it leans on it for 0.1 s at most"


def test_other_joints_feel_who_pushes_an_arm_whose_forearm_is_in_its_stop() -> None:
    robot = standing_at(float(SKELETON.lower_rad[ROLL]) - 0.02)
    pushed = np.zeros(25)
    pushed[NAMES.index("right_elbow_pitch")] = -1.2 * robot.watch.least_threshold_nm[ROLL - 1]
    pushed[ROLL] = 50.0 * robot.watch.least_threshold_nm[ROLL]
    robot.run(200, pushed)
    assert robot.watch.finding is not None
    assert "right_elbow_pitch" in robot.watch.finding
