"""How a run starts: the drives, the robots, the suit, then the master; wait until every robot is ready."""

from __future__ import annotations

from collections.abc import Awaitable, Callable

from common.errors import TandemError
from common.wire.messages import Action
from deploy.harness.engage import until_tracking
from deploy.harness.rig import DRIVES, Rig

START_S = 60.0
"""Processes up, filters settled, clock offset trusted, lease held."""


async def start_all(
    rig: Rig,
    timeout_s: float = START_S,
    check: Callable[[], None] | None = None,
    start: Callable[[str], Awaitable[None]] | None = None,
    home_key: str = "",
) -> None:
    """Start every process of a rig and wait until each robot may be engaged.

    `check` is called again and again, and may raise TandemError: without it, where a process has ended.
    `start` starts a process by its name, without it the rig does. `home_key`: a person at
    each robot confirms its posture with that key. Raises TandemError where it takes too long.
    """
    check, start = check or rig.check, start or rig.start
    observers = rig.observers.values()
    if DRIVES in rig.children:
        await start(DRIVES)
        await rig.until_logged(DRIVES, "drives on", timeout_s)
    for name in (*rig.slaves, "suit"):
        await start(name)
    await rig.until(lambda: all(o.state for o in observers), timeout_s, "state of every robot", check)
    for robot in rig.observers if home_key else ():
        await _confirm_posture(rig, robot, home_key, timeout_s, check)
    # the master last: processes that still start would take the time of its first ticks
    await start("master")
    await rig.until(lambda: all(o.ready for o in observers), timeout_s, "readiness of every robot", check)


async def _confirm_posture(
    rig: Rig, robot: str, key: str, timeout_s: float, check: Callable[[], None]
) -> None:
    """As `tandem home` does, once the robot asks for it."""
    observer = rig.observers[robot]

    def asks() -> bool:
        return observer.state is not None and "tandem home" in observer.state.reason

    await rig.until(asks, timeout_s, f"question of {robot} for its posture", check)
    reply = await rig.control(Action.HOME, key=key, robot=robot)
    if not reply.done:
        raise TandemError(f"{robot}: {reply.text}")


async def start_tracking(rig: Rig) -> None:
    """Start every process of a rig, and engage each robot until it tracks. Raises TandemError."""
    await start_all(rig)
    for robot in rig.observers:
        await until_tracking(rig, robot)
