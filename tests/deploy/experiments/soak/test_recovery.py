"""The soak's operator on a virtual clock: engages only a robot that holds and is ready, sees it back."""

from __future__ import annotations

import asyncio
from types import SimpleNamespace
from typing import cast

import pytest

from common.clock import NS_PER_S, to_ns
from common.errors import LinkTimeoutError
from common.wire.messages import Action, ControlReply
from deploy.experiments.soak.files.happenings import EngageAnswered
from deploy.experiments.soak.recovery import GIVE_UP_S, LOOK_S, Recovery, SoakOperator
from deploy.experiments.soak.stage import Stage
from deploy.harness.operator import GuardSight
from deploy.harness.rig import ROBOT


class Robot:
    """Silent, then it takes commands, then it is ready; engaged, it aligns and tracks."""

    def __init__(
        self, flows_s: float = 2.0, ready_s: float = 3.0, aligns_s: float = 1.0, refuses: int = 0
    ) -> None:
        self.now_ns = 0
        self.guard_state = "hold"
        self.engaged = 0
        self.guard_changes: list[GuardSight] = []
        self.asked: list[float] = []
        self.accepted_ns = to_ns(flows_s)
        self._flows_s, self._ready_s, self._refuses = flows_s, ready_s, refuses
        self._engaged_s = float("inf")

    @property
    def now_s(self) -> float:
        return self.now_ns / NS_PER_S

    @property
    def ready(self) -> bool:
        return self.now_s >= self._ready_s

    def guard(self, _: int) -> str:
        if self.now_s < self._flows_s:
            return "silent"
        if self.now_s < self._engaged_s:
            return self.guard_state
        return "track" if self.now_s >= self._engaged_s + 1.0 else "align"

    def flows(self, now_ns: int, since_ns: int = 0) -> bool:
        return now_ns >= to_ns(self._flows_s)

    def known(self) -> bool:
        return self.ready

    @property
    def state(self) -> SimpleNamespace:
        return SimpleNamespace(sent_ns=self.now_ns, guard=self.guard(self.now_ns), reason="")

    async def control(self, action: Action, robot: str) -> ControlReply:
        assert (action, robot) == (Action.ENGAGE, ROBOT)
        self.asked.append(self.now_s)
        if len(self.asked) <= self._refuses:
            if len(self.asked) == 1:
                raise LinkTimeoutError("no answer")
            return ControlReply(False, "hold", "still braking")
        self._engaged_s = self.now_s
        return ControlReply(True, "align", "engaged")

    async def sleep(self, seconds: float) -> None:
        self.now_ns += to_ns(seconds)


def recovered(robot: Robot) -> tuple[Recovery, list[EngageAnswered]]:
    told: list[EngageAnswered] = []
    rig = SimpleNamespace(observers={ROBOT: robot}, control=robot.control)
    stage = SimpleNamespace(watch=robot, rig=rig, record=told.append)
    operator = SoakOperator(cast(Stage, stage), lambda: robot.now_ns, robot.sleep)
    return asyncio.run(operator.recover(0)), told


def test_it_waits_for_readiness_engages_once_and_sees_it_follow() -> None:
    robot = Robot()
    recovery, told = recovered(robot)
    assert recovery.done
    assert recovery.flow_s == 2.0
    assert recovery.ready_s == pytest.approx(3.0, abs=LOOK_S)
    assert recovery.track_s == pytest.approx(1.0, abs=0.05)
    assert (recovery.engaged, robot.engaged, len(robot.asked)) == (1, 1, 1)
    assert told == [EngageAnswered(True)]


def test_a_robot_that_went_on_is_not_engaged() -> None:
    robot = Robot()
    robot.guard_state = "track"
    recovery, told = recovered(robot)
    assert recovery.done
    assert (recovery.track_s, recovery.engaged, told) == (None, 0, [])


def test_it_asks_again_when_it_was_refused_or_not_answered() -> None:
    recovery, told = recovered(Robot(refuses=2))
    assert recovery.done
    assert [what.done for what in told] == [False, False, True]
    assert [what.text for what in told] == ["no answer", "still braking", ""]
    assert recovery.engaged == 1


@pytest.mark.parametrize("guard", ["estop", "boot"])
def test_a_robot_that_does_not_hold_is_never_engaged(guard: str) -> None:
    robot = Robot()
    robot.guard_state = guard
    recovery, told = recovered(robot)
    assert not recovery.done
    assert robot.now_s >= GIVE_UP_S
    assert told == []
