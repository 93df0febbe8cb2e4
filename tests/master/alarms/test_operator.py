"""One operator's alarms, of several robots and the suit together."""

from common.clock import to_ns
from master.alarms.alarm import Alarm
from master.alarms.operator import OperatorAlarms
from master.alarms.situation import RobotSign

TRACK, HOLD = RobotSign("track"), RobotSign("hold", "no command for 0.20 s")


def test_any_robot_that_stops_following_is_told() -> None:
    alarms = OperatorAlarms()
    assert alarms.step(0, {"one": TRACK, "two": TRACK}, beyond_reach=False, doubts=False) is None
    at_ns = to_ns(0.1)
    assert alarms.step(at_ns, {"one": TRACK, "two": HOLD}, beyond_reach=False, doubts=False) is Alarm.HOLD


def test_the_suit_s_own_are_told_only_while_a_robot_follows() -> None:
    alarms = OperatorAlarms()
    still = {"one": RobotSign("hold", "waits")}
    assert alarms.step(0, still, beyond_reach=True, doubts=True) is None
    assert alarms.step(to_ns(1.0), {"one": TRACK}, beyond_reach=True, doubts=False) is Alarm.CLAMP
    assert alarms.step(to_ns(2.0), {"one": TRACK}, beyond_reach=False, doubts=True) is Alarm.WARNING


def test_a_pause_holds_for_what_was_active() -> None:
    alarms = OperatorAlarms()
    alarms.step(0, {"one": TRACK}, beyond_reach=False, doubts=False)
    alarms.step(1, {"one": HOLD}, beyond_reach=False, doubts=False)
    alarms.pause(2, 60.0)
    assert alarms.step(to_ns(30.0), {"one": HOLD}, beyond_reach=False, doubts=False) is None


def test_another_operator_s_robot_is_not_told_of() -> None:
    alarms = OperatorAlarms()
    alarms.step(0, {"one": RobotSign("track", ours=False)}, beyond_reach=True, doubts=True)
    assert alarms.step(1, {"one": HOLD}, beyond_reach=True, doubts=True) is None
