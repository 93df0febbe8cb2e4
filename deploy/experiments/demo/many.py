"""One operator, many robots: start them all, engage each by its name, watch, stop, and say how each fared."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from rich.console import Console
from rich.live import Live
from rich.text import Text

from common.clock import monotonic_ns
from common.errors import TandemError
from deploy.experiments.demo.many_report import ManyReport, make_many_report, many_table
from deploy.experiments.demo.operators import DemoOperators
from deploy.experiments.demo.report import Seen
from deploy.experiments.demo.run import START_S, DemoOptions, check
from deploy.harness.host import watch_host
from deploy.harness.rig import Rig, open_rig
from deploy.harness.start import start_all


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
    """Run it and judge it. Raises TandemError when a process fails or does not become ready."""
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
    async with watch_host() as host, rigging as rig:
        with Live(console=console, refresh_per_second=4, transient=True) as live:
            look = _look(rig, stop, live)
            start_s = START_S + 2.0 * robots  # they share the machine's cores while they start
            await start_all(rig, start_s, look)
            operators = DemoOperators(rig, host, look, lambda line: console.print(line, style="yellow"))
            await operators.follow(options.seconds, lambda: _measure(rig))
            if not operators.problem:
                await operators.let_go()
        seen = Seen(operators.rows(), host.figures(monotonic_ns()), operators.problem)
        return make_many_report(options, rig, await rig.stop(), seen)


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


def _measure(rig: Rig) -> None:
    for child in rig.children.values():
        child.measure(first=True)
