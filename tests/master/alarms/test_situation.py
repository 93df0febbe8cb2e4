"""What the operator is told of, from a robot's own words."""

import pytest

from master.alarms.alarm import Alarm
from master.alarms.situation import RobotAlarms, RobotSign


def after(*signs: RobotSign) -> frozenset[Alarm]:
    robot = RobotAlarms()
    for sign in signs[:-1]:
        robot.step(sign)
    return robot.step(signs[-1])


TRACK = RobotSign("track", "follows anna")


@pytest.mark.parametrize("engaged", ["align", "track", "clutch"])
def test_a_robot_that_stops_following_by_itself_is_heard(engaged: str) -> None:
    held = RobotSign("hold", "no command for 0.20 s")
    assert after(RobotSign(engaged), held) == {Alarm.HOLD}
    assert after(RobotSign(engaged), held, held, held) == {Alarm.HOLD}
    assert after(RobotSign(engaged), held, RobotSign("align")) == set()


def test_a_robot_that_never_followed_is_silent() -> None:
    assert after(RobotSign(), RobotSign("boot"), RobotSign("hold", "waits")) == set()


def test_who_disengages_needs_no_tone() -> None:
    assert after(TRACK, RobotSign("hold", "disengaged by anna")) == set()


def test_a_robot_that_falls_silent_while_it_follows_is_heard() -> None:
    assert after(TRACK, RobotSign()) == {Alarm.HOLD}
    assert after(TRACK, RobotSign(), TRACK) == set()


def test_a_contact_is_told_apart_from_other_holds() -> None:
    assert after(TRACK, RobotSign("hold", "pushed at left_hand or beyond: 9 N m")) == {Alarm.CONTACT}


def test_an_emergency_stop_lasts_until_its_reset() -> None:
    stopped = RobotSign("estop", "stop button")
    assert after(TRACK, stopped) == {Alarm.ESTOP}
    assert after(TRACK, stopped, RobotSign("hold", "reset by anna; engage to move")) == set()


def test_faults_are_warnings_while_it_follows() -> None:
    assert after(TRACK, RobotSign("track", "", faults=True)) == {Alarm.WARNING}
    assert after(TRACK, RobotSign("hold", "drive fault", faults=True)) == {Alarm.HOLD}
