"""Drives operators: receives the robots' states, and sends the requests that the operators decide on."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Protocol

from common.clock import Clock, monotonic_ns, to_ns, to_s
from common.errors import CodecError, LinkError, LinkTimeoutError, TandemError
from common.wire.messages import Action
from deploy.harness.observer import Observer
from deploy.harness.operator import GuardSight, Operator, OperatorPatience, UnaskedHold
from deploy.harness.rig import ROBOT, Rig

LOOK_S = 0.25
"""How often the operators look, unless an experiment says otherwise."""
TRACK_S = 60.0
DISENGAGE_S = 10.0
"""How long a robot may refuse to disengage."""
HOLD_S = 5.0
"""How soon a robot holds after it has disengaged."""


class GaveUpError(TandemError):
    """An operator gave up on a robot."""


class EngageAccess(Protocol):
    """How a driver sees one robot and asks it to engage."""

    @property
    def ready(self) -> bool:
        """Whether asking makes sense."""

    async def look(self) -> Sequence[GuardSight]:
        """What was seen since the last call, the newest state last. Raises TandemError."""

    async def engage(self) -> str:
        """Ask the robot to engage; its refusal, empty where it engages."""


class RigRobot:
    """A robot of a rig, seen by the rig's observer and asked over the link."""

    def __init__(self, rig: Rig, robot: str = ROBOT, waits_until_ready: bool = False) -> None:
        """`waits_until_ready`: it is asked only while it takes commands and every joint is known."""
        self._rig = rig
        self._robot = robot
        self._waits = waits_until_ready
        self._heard = len(self._observed.guard_changes)

    @property
    def _observed(self) -> Observer:
        return self._rig.observers[self._robot]

    @property
    def ready(self) -> bool:
        """Whether asking makes sense."""
        return not self._waits or self._observed.ready

    async def look(self) -> Sequence[GuardSight]:
        """Every change of the guard's state since the last call, and the newest state."""
        changes, state = self._observed.guard_changes, self._observed.state
        new, self._heard = changes[self._heard :], len(changes)
        return new if state is None else [*new, GuardSight(state.sent_ns, state.guard, state.reason)]

    async def engage(self) -> str:
        """Ask over the link. A robot that still brakes or receives no command yet refuses."""
        try:
            reply = await self._rig.control(Action.ENGAGE, robot=self._robot)
        except (LinkError, CodecError) as error:
            return str(error)
        return "" if reply.done else reply.text


class EngageDriver:
    """Carries out what one operator decides."""

    def __init__(
        self,
        operator: Operator,
        robot: EngageAccess,
        on_hold: Callable[[UnaskedHold], None] = lambda _: None,
        clock: Clock = monotonic_ns,
    ) -> None:
        """`on_hold` is called when a hold begins and when it is over."""
        self.operator = operator
        self._robot = robot
        self._on_hold = on_hold
        self._clock = clock

    async def turn(self) -> None:
        """Hear what is new, and engage where the operator would. Raises GaveUpError."""
        for sight in await self._robot.look():
            for hold in self.operator.see(sight):
                self._on_hold(hold)
        if why := self.operator.gives_up(self._clock()):
            raise GaveUpError(why)
        if self.operator.engages(self._clock(), self._robot.ready):
            refusal = await self._robot.engage()
            self.operator.answered(self._clock(), refusal)


async def until_all_track(
    drivers: Sequence[EngageDriver], check: Callable[[], None], pause_s: float = LOOK_S
) -> None:
    """Engage every robot until all track. Raises TandemError from `check`, or if an operator gives up."""
    while True:
        check()
        for driver in drivers:
            await driver.turn()
        if all(driver.operator.tracks for driver in drivers):
            return
        await asyncio.sleep(pause_s)


async def keep_engaged(
    drivers: Sequence[EngageDriver], seconds: float, check: Callable[[], None], pause_s: float = LOOK_S
) -> None:
    """Let the robots follow for so long, and engage each again where it holds. Raises TandemError."""
    began_ns = monotonic_ns()
    while to_s(monotonic_ns() - began_ns) < seconds:
        check()
        for driver in drivers:
            await driver.turn()
        await asyncio.sleep(pause_s)


async def until_tracking(
    rig: Rig, robot: str = ROBOT, timeout_s: float = TRACK_S, check: Callable[[], None] | None = None
) -> None:
    """Engage one robot of a rig until it tracks. Raises TandemError where it does not in time."""
    operator = Operator(robot, OperatorPatience(timeout_s), wanted_ns=monotonic_ns())
    await until_all_track([EngageDriver(operator, RigRobot(rig, robot))], check or rig.check)


async def disengage(rig: Rig, robot: str, check: Callable[[], None]) -> None:
    """Disengage one robot of a rig, until it holds. Raises TandemError where it does not."""
    observer, answer = rig.observers[robot], "no answer"
    deadline_ns = monotonic_ns() + to_ns(DISENGAGE_S)
    while True:
        with suppress(LinkTimeoutError):
            reply = await rig.control(Action.DISENGAGE, robot=robot)
            # the answer to an earlier request may have been lost: a robot that holds has disengaged
            if reply.done or reply.guard == "hold":
                break
            answer = reply.text
        if monotonic_ns() > deadline_ns:
            raise TandemError(f"{robot}: disengaging was refused for {DISENGAGE_S:g} s: {answer}")
        await asyncio.sleep(LOOK_S)
    await rig.until(lambda: observer.guard == "hold", HOLD_S, f"hold of {robot} after disengaging", check)
