"""One operator, many robots: start them all, engage each by its name, watch, stop, and say how each fared."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from rich.console import Console
from rich.live import Live
from rich.text import Text

from common.clock import monotonic_ns, to_ns
from common.errors import LinkTimeoutError, TandemError
from common.messages import Action
from deploy.demo.many_report import ManyReport, make_many_report, many_table
from deploy.demo.run import ALIGN_S, HOLD_S, START_S, DemoOptions, check
from deploy.rig.rig import Rig, at_most, open_rig

AGREE_S = 10.0
BECOMES = {Action.ENGAGE: ("align", "track"), Action.DISENGAGE: ("hold",)}


async def show_many(
    options: DemoOptions, robots: int, stop: asyncio.Event, console: Console, report: Path | None = None
) -> None:
    """Run it, print the table, write the report. Raises TandemError where the run failed."""
    if options.replay is not None or options.servos != "mujoco":
        raise TandemError("several robots follow the simulated operator in MuJoCo: leave --replay, --servos")
    result = await run_many(replace(options, camera=False), robots, stop, console)
    if report is not None:
        _write(report, result)
    console.print(many_table(result.tree))
    if result.problems:
        raise TandemError("the demo failed: " + "; ".join(result.problems))


def _write(path: Path, result: ManyReport) -> None:
    path.write_text(json.dumps(result.tree, indent=2, ensure_ascii=False) + "\n", "utf-8")


async def run_many(options: DemoOptions, robots: int, stop: asyncio.Event, console: Console) -> ManyReport:
    """Run it and judge it. Raises TandemError when a process fails or a robot never reaches `track`."""
    check(options)
    try:
        return await _story(options, robots, stop, console)
    except TandemError:
        if stop.is_set():
            raise TandemError("interrupted: nothing was judged") from None
        raise


async def _story(options: DemoOptions, robots: int, stop: asyncio.Event, console: Console) -> ManyReport:
    overrides = options.overrides()
    # robots have hosts of their own; here, with priority, they would starve who watches them
    overrides["slave"].append("process.realtime_priority=0")
    rigging = open_rig(options.transport, overrides, options.profile, robots)
    async with rigging as rig:
        with Live(console=console, refresh_per_second=4, transient=True) as live:
            look = _look(rig, stop, live)
            for name in (*rig.slaves, "suit"):
                await rig.start(name)
            everyone = rig.observers.values()
            start_s = START_S + 2.0 * robots  # they share the machine's cores while they start
            await rig.until(lambda: all(o.state for o in everyone), start_s, "word from every robot", look)
            await rig.start("master")
            await rig.until(lambda: all(o.ready for o in everyone), start_s, "readiness of every robot", look)
            await engage(rig)
            await rig.until(lambda: all(o.guard == "track" for o in everyone), ALIGN_S, "track of all", look)
            await _watch(rig, options.seconds, stop, look)
            for robot in rig.observers:
                await _must(rig, Action.DISENGAGE, robot)
            await rig.until(lambda: all(o.guard == "hold" for o in everyone), HOLD_S, "hold of all", look)
        return make_many_report(options, rig, await rig.stop())


async def engage(rig: Rig) -> None:
    """Engage each robot. Raises TandemError with the robot's words where one refuses."""
    for robot in rig.observers:
        await _must(rig, Action.ENGAGE, robot)


async def _must(rig: Rig, action: Action, robot: str) -> None:
    """Ask until it is so: a machine that is short of cores may be late, and its guards refuse rightly."""
    said = "no answer"
    deadline_ns = monotonic_ns() + to_ns(AGREE_S)
    while monotonic_ns() < deadline_ns:
        with suppress(LinkTimeoutError):
            reply = await rig.control(action, robot=robot)
            # an answer that came too late may have been a yes
            if reply.done or reply.guard in BECOMES[action]:
                return
            said = reply.text
        await asyncio.sleep(0.25)
    raise TandemError(f"{robot}: {action} was refused for {AGREE_S:g} s: {said}")


def _look(rig: Rig, stop: asyncio.Event, live: Live) -> Callable[[], None]:
    def look() -> None:
        if stop.is_set():
            raise TandemError("interrupted")
        for child in rig.children.values():
            child.check()
            child.measure()
        guards = "   ".join(f"{robot} {observer.guard}" for robot, observer in rig.observers.items())
        live.update(Text(guards))

    return look


async def _watch(rig: Rig, seconds: float, stop: asyncio.Event, look: Callable[[], None]) -> None:
    for child in rig.children.values():
        child.measure(first=True)
    for observer in rig.observers.values():
        observer.recording = True
    until_ns = monotonic_ns() + to_ns(seconds)
    while monotonic_ns() < until_ns:
        look()
        await at_most(stop.wait(), 0.25)
    for observer in rig.observers.values():
        observer.recording = False
