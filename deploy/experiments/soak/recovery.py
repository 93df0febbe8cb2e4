"""How a soak's robot comes back: how soon commands flow, it is ready, it follows; it is engaged each time."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from dataclasses import dataclass

from common.clock import Clock, monotonic_ns, to_ns, to_s
from deploy.experiments.soak.files.happenings import EngageAnswered
from deploy.experiments.soak.stage import Stage
from deploy.harness.engage import EngageDriver, RigRobot
from deploy.harness.operator import Operator
from deploy.harness.rig import ROBOT

Sleep = Callable[[float], Awaitable[None]]
LOOK_S = 0.02
SETTLE_S = 0.3
"""After an answer, until states show its effect."""
GIVE_UP_S = 90.0
"""A robot that does not follow again within this is counted as not recovered."""


@dataclass(slots=True)
class Recovery:
    """How it came back; seconds. None where it did not come so far."""

    done: bool = False
    flow_s: float | None = None
    """From when the fault was undone until the robot took a command again."""
    ready_s: float | None = None
    """From then until it could be engaged; None too where it never stopped following."""
    track_s: float | None = None
    """From the (last) engagement until it followed."""
    engaged: int = 0
    """How often it was engaged."""
    refused: str = ""
    """What it last answered when it did not engage."""


class SoakRobot(RigRobot):
    """The soak's robot. It is engaged only while it is heard; each request to engage is an event."""

    def __init__(self, stage: Stage, clock: Clock = monotonic_ns) -> None:
        super().__init__(stage.rig, waits_until_ready=True)
        self._stage = stage
        self._clock = clock

    @property
    def ready(self) -> bool:
        """Whether it was heard just now, holds, takes commands, and every joint is known."""
        return self._stage.watch.guard(self._clock()) == "hold" and super().ready

    async def engage(self) -> str:
        """Ask it to engage; its refusal, empty where it engages."""
        refusal = await super().engage()
        self._stage.watch.engaged += not refusal
        self._stage.record(EngageAnswered(not refusal, refusal))
        return refusal


class SoakOperator:
    """Brings the robot back after a fault, and measures how long each step takes."""

    def __init__(self, stage: Stage, clock: Clock = monotonic_ns, sleep: Sleep = asyncio.sleep) -> None:
        self._watch = stage.watch
        self._robot = SoakRobot(stage, clock)
        self._clock = clock
        self._sleep = sleep

    @property
    def follows(self) -> bool:
        """Whether all is well: the robot tracks, commands flow, and every joint is known."""
        now_ns = self._clock()
        watch = self._watch
        return watch.guard(now_ns) == "track" and watch.flows(now_ns) and watch.known()

    async def recover(self, undone_ns: int) -> Recovery:
        """Wait, and engage, until the robot follows again. `undone_ns`: when the fault was undone."""
        operator, recovery = Operator(ROBOT, again_s=SETTLE_S), Recovery()
        driver = EngageDriver(operator, self._robot, clock=self._clock)
        while self._clock() - undone_ns < to_ns(GIVE_UP_S):
            now_ns = self._clock()
            if recovery.flow_s is None and self._watch.flows(now_ns, undone_ns):
                recovery.flow_s = to_s(self._watch.accepted_ns - undone_ns)
            if recovery.flow_s is not None and self.follows:
                recovery.track_s = to_s(now_ns - operator.engaged_ns) if operator.engaged_ns else None
                recovery.done = True
                break
            if recovery.ready_s is None and self._robot.ready:
                recovery.ready_s = to_s(now_ns - undone_ns)
            await driver.turn()
            await self._sleep(LOOK_S)
        recovery.engaged, recovery.refused = operator.engaged, operator.refused
        return recovery
