"""Brings a robot of a rig into `track`, as a person does: engages, and engages again where the robot held."""

from __future__ import annotations

import asyncio
from contextlib import suppress

from common.clock import monotonic_ns, to_ns
from common.errors import LinkTimeoutError, TandemError
from common.wire.messages import Action
from deploy.harness.rig import ROBOT, Rig, at_most

TRACK_S = 60.0
AGAIN_S = 0.25
"""How long a person waits before he asks again."""


async def until_tracking(rig: Rig, robot: str = ROBOT, timeout_s: float = TRACK_S) -> None:
    """Engage the robot until it tracks. Raises TandemError with its words where it does not in time."""
    observer, said = rig.observers[robot], "not asked"
    deadline_ns = monotonic_ns() + to_ns(timeout_s)
    while observer.guard != "track":
        for child in rig.children.values():
            child.check()
        if monotonic_ns() > deadline_ns:
            missing = observer.waiting_for()
            raise TandemError(f"{robot} did not track within {timeout_s:g} s: {missing}; engage: {said}")
        if observer.guard == "hold":
            with suppress(LinkTimeoutError):
                said = (await rig.control(Action.ENGAGE, robot=robot)).text
            await asyncio.sleep(AGAIN_S)
        else:
            await at_most(observer.news(), AGAIN_S)
