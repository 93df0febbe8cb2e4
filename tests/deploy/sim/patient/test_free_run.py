"""The robot follows through the air: by the whole pipeline, and its setpoints again for other robots."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from common.quaternion import Array
from common.skeleton import load_skeleton
from deploy.sim.patient.free_run import MOST_STOPS, FreeFlight, PatientOperator, free_run, of_motion
from deploy.sim.patient.replay import held, replay
from deploy.sim.patient.robot import Imperfect
from slave.contact.config import ContactConfig, ContactJoint

SKELETON = load_skeleton("nursing")
PLAIN, USUAL = Imperfect(mass_share=0.05), ContactConfig()
TOUCHY = ContactConfig(
    model_error=0.0, joints=dict.fromkeys(SKELETON.joint_names, ContactJoint(threshold_nm=0.5))
)
"""Each motion crosses these thresholds."""


@pytest.fixture(scope="module")
def flight() -> FreeFlight:
    out = FreeFlight(of_motion("bottle", SKELETON), PLAIN, USUAL)
    out.follow(6.0)
    return out


def test_a_motion_through_the_air_is_no_contact(flight: FreeFlight) -> None:
    assert flight.found.followed_s > 6.0
    assert flight.found.false_stops == flight.found.other_stops == ()
    assert 0.1 < flight.found.nearest < 0.9


def test_the_setpoints_again_are_the_same_way(flight: FreeFlight) -> None:
    again = replay(flight.setpoints_rad, PLAIN, USUAL)
    assert again.nearest == flight.found.nearest
    assert again.joint == flight.found.joint
    assert again.seconds > 6.0


def test_thresholds_that_motion_crosses_are_found_by_both_ways(flight: FreeFlight) -> None:
    assert replay(flight.setpoints_rad, PLAIN, TOUCHY).findings != ()
    stopped = free_run(of_motion("bottle", SKELETON), 6.0, PLAIN, TOUCHY)
    assert 0 < len(stopped.false_stops) <= MOST_STOPS


def test_a_declared_load_is_known_to_the_watch(flight: FreeFlight) -> None:
    heavy = replace(PLAIN, payload_kg=2.5)
    assert replay(flight.setpoints_rad, heavy, USUAL).findings != ()
    assert replay(flight.setpoints_rad, heavy, USUAL, held(2.5)).findings == ()


def test_torques_told_late_are_allowed_for() -> None:
    """Both shoulders swing faster and faster: a cycle of lateness is allowed for, four are not."""
    t_s = 0.005 * np.arange(300)
    swing = 0.45 * np.sin(2.0 * np.pi * 1.2 * t_s) * np.minimum(1.0, t_s) ** 2
    setpoints = np.zeros((len(t_s), 25))
    for side in ("left", "right"):
        setpoints[:, SKELETON.joint_names.index(f"{side}_shoulder_pitch")] = swing
    fine = Imperfect(drive_bits=16)
    assert replay(setpoints, fine, USUAL).findings == ()
    assert replay(setpoints, fine, ContactConfig(effort_late_s=0.0)).findings != ()
    assert replay(setpoints, replace(fine, late_cycles=4), USUAL).findings != ()


def test_the_operator_waits_while_the_robot_aligns() -> None:
    """Somebody who runs about is never aligned with: the motion goes on once the robot tracks."""

    def turns(t_s: float) -> tuple[Array, Array]:
        posture = np.zeros(25)
        posture[SKELETON.joint_names.index("neck_yaw")] = 0.6 * np.cos(4.0 * t_s)
        return posture, np.zeros(25)

    run = free_run(turns, 1.0, PLAIN, USUAL)
    assert run.other_stops == ()
    assert run.followed_s > 1.5


def test_an_operator_who_waits_does_not_move() -> None:
    operator = PatientOperator(lambda t_s: (np.full(25, t_s), np.ones(25)))
    assert not operator(5.0)[1].any()
    operator.waits, operator.moved_s = False, 0.5
    position, velocity = operator(5.0)
    assert (position == 0.5).all()
    assert (velocity == 1.0).all()


def test_drives_that_tell_fine_angles_are_no_contact_where_arms_press_onto_each_other() -> None:
    """What is foretold to jump is excused there: no torque that is told a cycle late shows it."""
    fine = Imperfect(drive_bits=16, mass_share=0.05, seed=1)
    found = free_run(of_motion("crossed", SKELETON), 8.0, fine, ContactConfig())
    assert (found.false_stops, found.other_stops) == ((), ())
    assert found.nearest < 0.9
