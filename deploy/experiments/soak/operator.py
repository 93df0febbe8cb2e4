"""The soak's operator: sees that the robot has come back, and engages it by an act of his own."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from dataclasses import asdict, dataclass
from typing import Any

from common.clock import Clock, monotonic_ns, to_ns, to_s
from common.errors import CodecError, LinkError
from common.wire.messages import Action
from deploy.experiments.soak.stage import Stage

Sleep = Callable[[float], Awaitable[None]]
LOOK_S = 0.02
SETTLE_S = 0.3
"""After an answer, until states tell of it."""
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

    def tree(self) -> dict[str, Any]:
        """Plain values, rounded."""
        return {k: round(v, 3) if isinstance(v, float) else v for k, v in asdict(self).items()}


class Operator:
    """Engages where the robot waits for it; never sooner, never by itself."""

    def __init__(self, stage: Stage, clock: Clock = monotonic_ns, sleep: Sleep = asyncio.sleep) -> None:
        self._stage = stage
        self._watch = stage.watch
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
        recovery = Recovery()
        engaged_ns = 0
        while self._clock() - undone_ns < to_ns(GIVE_UP_S):
            now_ns = self._clock()
            if recovery.flow_s is None and self._watch.flows(now_ns, undone_ns):
                recovery.flow_s = to_s(self._watch.accepted_ns - undone_ns)
            if recovery.flow_s is not None and self.follows:
                recovery.track_s = to_s(now_ns - engaged_ns) if engaged_ns else None
                recovery.done = True
                return recovery
            if self._watch.guard(now_ns) == "hold" and self._stage.rig.observer.ready:
                recovery.ready_s = to_s(now_ns - undone_ns) if recovery.ready_s is None else recovery.ready_s
                if await self._engage(recovery):
                    engaged_ns = self._clock()
                await self._sleep(SETTLE_S)
            await self._sleep(LOOK_S)
        return recovery

    async def _engage(self, recovery: Recovery) -> bool:
        try:
            reply = await self._stage.rig.control(Action.ENGAGE)
        except (LinkError, CodecError) as error:
            done, recovery.refused = False, str(error)
        else:
            done, recovery.refused = reply.done, "" if reply.done else reply.text
        if done:
            recovery.engaged += 1
            self._watch.engaged += 1
        self._stage.tell("engage", {"done": done, "text": recovery.refused})
        return done
