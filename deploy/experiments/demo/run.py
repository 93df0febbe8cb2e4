"""The story of one demo: start, wait, engage, follow, disengage, stop, judge. Open this file first."""

from __future__ import annotations

import asyncio
import tempfile
from contextlib import AsyncExitStack
from pathlib import Path

from rich.console import Console
from rich.live import Live

from common.clock import monotonic_ns, to_s
from common.errors import TandemError
from common.skeleton import load_skeleton
from deploy.experiments.demo.alignment import align
from deploy.experiments.demo.operators import DemoOperators
from deploy.experiments.demo.options import RECORDED, DemoOptions
from deploy.experiments.demo.report import DemoReport, RunNotes, make_report
from deploy.experiments.demo.view import draw
from deploy.harness.console import ConsoleChild
from deploy.harness.engage import until_tracking
from deploy.harness.host import HostWatch, watch_host
from deploy.harness.recorders import start_recorders
from deploy.harness.rig import Rig, open_rig
from deploy.harness.start import start_all

LOOK_S = 0.25
START_S, START_EACH_S = 30.0, 2.0
"""How long a demo may take to start, and so much more for each robot: they share this machine's cores."""


async def run_demo(options: DemoOptions, stop: asyncio.Event, console: Console) -> DemoReport:
    """Run it and judge it. Raises TandemError when a process fails or does not become ready."""
    try:
        return await _story(options, stop, console)
    except TandemError:
        # a Ctrl-C reaches the processes too: that they end is then no failure
        if stop.is_set():
            raise TandemError("interrupted: nothing was judged") from None
        raise


async def keep_demo(options: DemoOptions, stop: asyncio.Event, console: Console) -> None:
    """Start it, engage once, and leave the robots to whoever is at the page, until `stop` is set.

    Raises TandemError when a process fails or does not become ready.
    """
    async with AsyncExitStack() as stack:
        _, rig, show = await _started(options, stop, console, stack)
        try:
            for robot in rig.observers:
                await _engaged(rig, robot, show, console)
            console.print("all goes on until Ctrl-C", style="green")
            while not stop.is_set():
                show.look()
                await asyncio.sleep(LOOK_S)
        except TandemError:
            if not stop.is_set():
                raise


async def _engaged(rig: Rig, robot: str, show: _Show, console: Console) -> None:
    """Engage a robot; where it refuses, as somebody stopped it on the page, it is left to the page."""
    try:
        await until_tracking(rig, robot)
    except TandemError as error:
        show.look()  # raises where a process has ended
        console.print(f"{error}: engage it on the page", style="yellow")
    else:
        console.print(f"{robot} follows", style="green")


async def _started(
    options: DemoOptions, stop: asyncio.Event, console: Console, stack: AsyncExitStack
) -> tuple[HostWatch, Rig, _Show]:
    """Everything runs and is ready; it ends with the stack."""
    options.check()
    overrides = options.overrides()
    if options.replay is not None:
        folder = stack.enter_context(tempfile.TemporaryDirectory(prefix="tandem-alignment-"))
        overrides["master"] += await _align(options, options.replay, Path(folder), console)
    taps = _taps(options, overrides, stack)
    host = await stack.enter_async_context(watch_host())
    rigging = open_rig(
        options.transport, overrides, options.profile, options.robots, options=options.command_options()
    )
    rig = await stack.enter_async_context(rigging)
    live = stack.enter_context(Live(console=console, refresh_per_second=4, transient=True))
    show = _Show(rig, host, stop, live)
    start_s = START_S + START_EACH_S * options.robots
    await start_all(rig, start_s, show.look, home_key=options.home_key)
    if options.record is not None:
        options.record.mkdir(parents=True, exist_ok=True)
        for file in await start_recorders(rig, taps, options.record):
            console.print(f"recorded into {file}", highlight=False, soft_wrap=True)
    if options.console:
        page = ConsoleChild(rig)
        await page.start(options.listen)
        for line in (f"web page: {page.operator_address}", f"for engineers: {page.engineer_address}"):
            console.print(line, style="bold", highlight=False, soft_wrap=True)
    return host, rig, show


def _taps(options: DemoOptions, overrides: dict[str, list[str]], stack: AsyncExitStack) -> dict[str, Path]:
    """Where each process hands on what it does, by name: only where a page or a recorder reads it."""
    read = RECORDED if options.record is not None else ("master",) if options.console else ()
    if not read:
        return {}
    folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="tandem-tap-")))
    taps = {name: folder / f"{name}.sock" for name in read}
    for name, tap in taps.items():
        overrides[name] += [f'tap.socket="{tap}"']
    return taps


async def _story(options: DemoOptions, stop: asyncio.Event, console: Console) -> DemoReport:
    async with AsyncExitStack() as stack:
        host, rig, show = await _started(options, stop, console, stack)
        operators = DemoOperators(rig, host, show.look, lambda line: console.print(line, style="yellow"))
        await operators.follow(options.seconds, show.begin)
        if not operators.problem:
            await operators.let_go()
        notes = RunNotes(operators.holds(), host.metrics(monotonic_ns()), operators.problem)
        return make_report(options, rig, await rig.stop(), notes)


async def _align(options: DemoOptions, replay: Path, folder: Path, console: Console) -> list[str]:
    """The overrides of the master's file for sensors that sit askew."""
    console.print(f"finding the sensor-to-segment alignment from {replay.name} …")
    aligned = await asyncio.to_thread(align, replay, load_skeleton(options.profile), folder)
    for name, why in aligned.left.items():
        console.print(f"[yellow]{name}: aligned by the zero pose alone ({why})", highlight=False)
    return aligned.overrides


class _Show:
    """Keeps an eye on the processes, the operator's Ctrl-C and the screen."""

    def __init__(self, rig: Rig, host: HostWatch, stop: asyncio.Event, live: Live) -> None:
        self._rig = rig
        self._host = host
        self._stop = stop
        self._live = live
        self._began_ns = 0

    def begin(self) -> None:
        """From now on usage is measured and time is shown."""
        for child in self._rig.children.values():
            child.measure(first=True)
        self._began_ns = monotonic_ns()

    def look(self) -> None:
        """Fail early, measure, and draw."""
        if self._stop.is_set():
            raise TandemError("interrupted")
        self._rig.check()
        for child in self._rig.children.values():
            child.measure()
        elapsed_s = to_s(monotonic_ns() - self._began_ns) if self._began_ns else 0.0
        self._live.update(draw(self._rig, self._host.missed, elapsed_s))
