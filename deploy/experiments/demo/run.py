"""The story of one demo: start, wait, engage, watch, disengage, stop, judge."""

from __future__ import annotations

import asyncio
import tempfile
from contextlib import AsyncExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from rich.console import Console
from rich.live import Live

from common.clock import monotonic_ns
from common.config.load import load_config
from common.errors import TandemError
from common.skeleton import load_skeleton
from deploy.examples.profiles import NURSING, example
from deploy.experiments.demo.alignment import align
from deploy.experiments.demo.operators import DemoOperators
from deploy.experiments.demo.report import Report, Seen, make_report
from deploy.experiments.demo.view import draw
from deploy.harness.host import Host, watch_host
from deploy.harness.rig import Rig, open_rig
from deploy.harness.start import start_all
from deploy.sim.suit.config import SuitConfig
from master.config import MasterConfig
from slave.config import SlaveConfig

START_S = 30.0
"""Processes up, filters settled, clock trusted, lease held."""


@dataclass(frozen=True, slots=True)
class DemoOptions:
    """What the command line chose."""

    profile: str = NURSING
    seconds: float = 20.0
    transport: str = "tcp"
    replay: Path | None = None
    motion: str | None = None
    """None: the one in the profile's example file."""
    strategy: str = "predict"
    filter: str = "vqf"
    seed: int = 1
    servos: Literal["mujoco", "canopen"] = "mujoco"
    """`canopen`: simulated drives in a process of their own, on two CAN buses."""
    camera: bool = True
    """Whether the robot shows what it sees."""

    def overrides(self) -> dict[str, list[str]]:
        """What it changes in the processes' files."""
        suit = [f"seed={self.seed}"]
        if self.motion is not None:
            suit.append(f'motion="{self.motion}"')
        # simulated and recorded operators begin in the zero pose: zeroed there, as the paper's reference was
        master = [f'estimation.filter="{self.filter}"', "estimation.zero_pose_s=1.0"]
        if self.replay is not None:
            suit.append(f'replay="{self.replay.resolve()}"')
        slave = [f'track.strategy="{self.strategy}"', f'camera.source="{"robot" if self.camera else "off"}"']
        overrides = {"slave": slave, "suit": suit, "master": master}
        if self.servos == "canopen":
            slave.append('servos.backend="canopen"')
            overrides["drives"] = []
        return overrides


async def run_demo(options: DemoOptions, stop: asyncio.Event, console: Console) -> Report:
    """Run it and judge it. Raises TandemError when a process fails or does not become ready."""
    try:
        return await _story(options, stop, console)
    except TandemError:
        # a Ctrl-C reaches the processes too: that they end is then no failure
        if stop.is_set():
            raise TandemError("interrupted: nothing was judged") from None
        raise


def check(options: DemoOptions) -> None:
    """Read the files as the processes will. Raises ConfigError for what they would refuse."""
    overrides = options.overrides()
    load_config(example("suit", options.profile), SuitConfig, overrides["suit"])
    load_config(example("slave", options.profile), SlaveConfig, overrides["slave"])
    load_config(example("master", options.profile), MasterConfig, overrides["master"])


async def _story(options: DemoOptions, stop: asyncio.Event, console: Console) -> Report:
    check(options)
    async with AsyncExitStack() as stack:
        overrides = options.overrides()
        if options.replay is not None:
            folder = stack.enter_context(tempfile.TemporaryDirectory(prefix="tandem-alignment-"))
            overrides["master"] += await _align(options, options.replay, Path(folder), console)
        host = await stack.enter_async_context(watch_host())
        rig = await stack.enter_async_context(open_rig(options.transport, overrides, options.profile))
        with Live(console=console, refresh_per_second=4, transient=True) as live:
            show = _Show(rig, host, stop, live)
            await start_all(rig, START_S, show.look)
            operators = DemoOperators(rig, host, show.look, lambda line: console.print(line, style="yellow"))
            await operators.follow(options.seconds, show.begin)
            if not operators.problem:
                await operators.let_go()
        seen = Seen(operators.rows(), host.figures(monotonic_ns()), operators.problem)
        return make_report(options, rig, await rig.stop(), seen)


async def _align(options: DemoOptions, replay: Path, folder: Path, console: Console) -> list[str]:
    """What the master's file must say of sensors that sit askew."""
    console.print(f"finding from {replay.name} how its sensors sit …")
    aligned = await asyncio.to_thread(align, replay, load_skeleton(options.profile), folder)
    for name, why in aligned.left.items():
        console.print(f"[yellow]{name}: by the zero pose alone ({why})", highlight=False)
    return aligned.overrides


class _Show:
    """Keeps an eye on the processes, the operator's Ctrl-C and the screen."""

    def __init__(self, rig: Rig, host: Host, stop: asyncio.Event, live: Live) -> None:
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
        for child in self._rig.children.values():
            child.check()
            child.measure()
        elapsed_s = (monotonic_ns() - self._began_ns) / 1e9 if self._began_ns else 0.0
        self._live.update(draw(self._rig, self._host.missed, elapsed_s))
