"""The driver of operators, on made-up robots: it engages, engages again, and ends where one gives up."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from types import SimpleNamespace
from typing import cast

import pytest

from common.clock import monotonic_ns
from common.errors import LinkTimeoutError
from common.wire.messages import Action, ControlReply
from deploy.harness.engage import EngageDriver, GaveUpError, RigRobot, keep_engaged, until_all_track
from deploy.harness.operator import GuardSight, Operator, OperatorPatience, UnaskedHold
from deploy.harness.rig import ROBOT, Rig


class MadeUpRobot:
    """Shows one of these guard states at each look; refuses so many times, then engages."""

    def __init__(self, *guards: str, refuses: int = 0) -> None:
        self.guards = list(guards)
        self.ready = True
        self.asked = 0
        self._refuses = refuses

    async def look(self) -> Sequence[GuardSight]:
        guard = self.guards.pop(0) if len(self.guards) > 1 else self.guards[0]
        return [GuardSight(monotonic_ns(), guard, "because")]

    async def engage(self) -> str:
        self.asked += 1
        return "still braking" if self.asked <= self._refuses else ""


def turns(driver: EngageDriver, count: int) -> None:
    async def story() -> None:
        for _ in range(count):
            await driver.turn()

    asyncio.run(story())


def test_it_engages_a_robot_that_holds_and_again_after_a_refusal_and_a_hold() -> None:
    robot = MadeUpRobot("hold", "hold", "align", "track", "hold", "align", "track", refuses=1)
    holds: list[UnaskedHold] = []
    driver = EngageDriver(Operator(ROBOT), robot, holds.append)
    turns(driver, 7)
    assert (robot.asked, driver.operator.engaged) == (3, 2)
    # the hold is reported when it begins and when it is over
    assert [hold.was for hold in holds] == ["track", "track"]
    assert holds[0] is holds[1]
    assert holds[0].tracked_ns is not None


def test_a_robot_that_is_not_ready_is_not_asked() -> None:
    robot = MadeUpRobot("hold")
    robot.ready = False
    turns(EngageDriver(Operator(ROBOT), robot), 3)
    assert robot.asked == 0


def test_all_robots_are_brought_to_track_and_an_error_of_the_check_passes() -> None:
    robots = [MadeUpRobot("hold", "align", "track"), MadeUpRobot("hold", "align", "align", "track")]
    drivers = [EngageDriver(Operator(ROBOT), robot) for robot in robots]
    asyncio.run(until_all_track(drivers, lambda: None, pause_s=0.0))
    assert [robot.asked for robot in robots] == [1, 1]

    def check() -> None:
        raise GaveUpError("interrupted")

    with pytest.raises(GaveUpError, match="interrupted"):
        asyncio.run(keep_engaged(drivers, 1.0, check, pause_s=0.0))


def test_an_operator_who_gives_up_ends_it() -> None:
    operator = Operator(ROBOT, OperatorPatience(back_s=0.0), wanted_ns=monotonic_ns())
    with pytest.raises(GaveUpError, match="robot-1 did not track for 0 s: hold"):
        asyncio.run(until_all_track([EngageDriver(operator, MadeUpRobot("hold"))], lambda: None, 0.0))


def test_a_robot_of_a_rig_shows_every_change_once_and_its_newest_state() -> None:
    observer = SimpleNamespace(guard_changes=[GuardSight(1, "hold", "")], state=None, ready=False)
    answers: list[ControlReply | None] = [
        None,
        ControlReply(False, "hold", "no"),
        ControlReply(True, "align", ""),
    ]

    async def control(action: Action, robot: str) -> ControlReply:
        assert (action, robot) == (Action.ENGAGE, ROBOT)
        answer = answers.pop(0)
        if answer is None:
            raise LinkTimeoutError("no answer")
        return answer

    rig = cast(Rig, SimpleNamespace(observers={ROBOT: observer}, control=control))

    async def story() -> None:
        robot = RigRobot(rig)
        assert robot.ready
        assert not RigRobot(rig, waits_until_ready=True).ready
        assert await robot.look() == []
        observer.guard_changes += [GuardSight(2, "align", ""), GuardSight(3, "track", "")]
        observer.state = SimpleNamespace(sent_ns=4, guard="track", reason="follows")
        assert [sight.at_ns for sight in await robot.look()] == [2, 3, 4]
        assert [sight.at_ns for sight in await robot.look()] == [4]
        assert [await robot.engage() for _ in range(3)] == ["no answer", "no", ""]

    asyncio.run(story())
