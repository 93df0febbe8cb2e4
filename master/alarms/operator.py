"""All alarms of one operator: her robots' and her suit's. Pure."""

from __future__ import annotations

from collections.abc import Mapping

from master.alarms.alarm import Alarm
from master.alarms.rule import AlarmRule
from master.alarms.situation import RobotAlarms, RobotSign


class OperatorAlarms:
    """Which tone is due, from what is known of each robot and of the suit."""

    def __init__(self) -> None:
        self._robots: dict[str, RobotAlarms] = {}
        self._rule = AlarmRule()

    def pause(self, now_ns: int, for_s: float) -> None:
        """Silence what is active now; see `AlarmRule`."""
        self._rule.pause(now_ns, for_s)

    def step(
        self, now_ns: int, signs: Mapping[str, RobotSign], *, beyond_reach: bool, doubts: bool
    ) -> Alarm | None:
        """The alarm that begins now. The suit's count only while a robot follows, not while one dresses.

        A robot without a sign is not commanded any more.
        """
        self._robots = {name: self._robots.get(name) or RobotAlarms() for name in signs}
        active = set[Alarm]().union(*(self._robots[name].step(sign) for name, sign in signs.items()))
        if any(robot.engaged for robot in self._robots.values()):
            active |= {Alarm.CLAMP} if beyond_reach else set()
            active |= {Alarm.WARNING} if doubts else set()
        return self._rule.step(now_ns, active)
