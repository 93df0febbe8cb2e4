"""Runs the operators beside a rig: hears states, engages, watches the processes, and says what happened."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import Any

from common.clock import monotonic_ns, to_ns
from common.errors import LinkTimeoutError, TandemError
from common.wire.messages import Action
from deploy.harness.host import Host
from deploy.harness.observer import Observer
from deploy.harness.operator import Operator
from deploy.harness.rig import Rig, at_most

LOOK_S = 0.25
"""How often the operator looks."""
AGREE_S = 10.0
"""How long he asks the robot to stand at the end."""
HOLD_S = 5.0


class Tending:
    """The operators of a rig's robots; `problem` says why they gave up, empty while they did not."""

    def __init__(
        self, rig: Rig, host: Host, stop: asyncio.Event, look: Callable[[], None], say: Callable[[str], None]
    ) -> None:
        self._rig = rig
        self._stop = stop
        self._look = look
        self._say = say
        self._heard = dict.fromkeys(rig.observers, 0)
        self.operators = [Operator(robot, host.lost_before) for robot in rig.observers]
        self.problem = ""

    async def until_all_track(self) -> None:
        """Engage every robot and wait for it, or until there is a problem."""
        for operator in self.operators:
            operator.begin(monotonic_ns())
            self._rig.observers[operator.robot].recording = True
        while not self.problem and not all(operator.tracks for operator in self.operators):
            await self._turn()

    async def watch(self, seconds: float) -> None:
        """Keep them in `track` for so long, and until those that hold then are back; or to a problem."""
        until_ns = monotonic_ns() + to_ns(seconds)
        while not self.problem and monotonic_ns() < until_ns:
            await self._turn()
        while not self.problem and not all(operator.tracks for operator in self.operators):
            await self._turn()

    async def let_go(self) -> None:
        """End the recording and disengage every robot. Raises TandemError where one does not hold then."""
        for observer in self._rig.observers.values():
            observer.recording = False
        for robot, observer in self._rig.observers.items():
            await self._disengage(robot)
            await self._rig.until(
                partial(_holds, observer), HOLD_S, f"hold of {robot} after disengaging", self._look
            )

    def rows(self) -> list[dict[str, Any]]:
        """A report's `holds`, in the order in which they happened."""
        rows = [operator.row(hold) for operator in self.operators for hold in operator.holds]
        return sorted(rows, key=lambda row: float(row["at_s"]))

    async def _turn(self) -> None:
        self._look()
        for operator in self.operators:
            states = self._rig.observers[operator.robot].states
            new = states[self._heard[operator.robot] :]
            self._heard[operator.robot] = len(states)
            for line in operator.see(new):
                self._say(line)
            self.problem = self.problem or operator.gives_up(monotonic_ns()) or ""
            if operator.wants_to_engage and not self.problem:
                await self._engage(operator)
        await at_most(self._stop.wait(), LOOK_S)

    async def _engage(self, operator: Operator) -> None:
        # a robot that still brakes, or hears no operator yet, refuses and tells why: he asks again
        with suppress(LinkTimeoutError):
            reply = await self._rig.control(Action.ENGAGE, robot=operator.robot)
            operator.refused = "" if reply.done else reply.text

    async def _disengage(self, robot: str) -> None:
        said = "no answer"
        deadline_ns = monotonic_ns() + to_ns(AGREE_S)
        while monotonic_ns() < deadline_ns:
            with suppress(LinkTimeoutError):
                reply = await self._rig.control(Action.DISENGAGE, robot=robot)
                # an answer that came too late may have been a yes
                if reply.done or reply.guard == "hold":
                    return
                said = reply.text
            await asyncio.sleep(LOOK_S)
        raise TandemError(f"{robot}: disengaging was refused for {AGREE_S:g} s: {said}")


def _holds(observer: Observer) -> bool:
    return observer.guard == "hold"
