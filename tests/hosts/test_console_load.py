"""What pages cost, and that they delay no command: also one that stands still, and one that sends garbage."""

from __future__ import annotations

import asyncio
import signal
import sys
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest

from common.clock import monotonic_ns, to_ms, to_ns, to_s
from common.latency.one_way import master_offset, one_way_ns
from common.wire.messages import RobotState
from deploy.harness.console import ConsoleChild
from deploy.harness.engage import until_tracking
from deploy.harness.host import HostWatch
from deploy.harness.rig import ROBOT, Rig, open_rig
from deploy.harness.start import start_all

if TYPE_CHECKING:
    from deploy.harness.observer import Heard
    from tests.conftest import OnThisHost

pytestmark = [pytest.mark.live, pytest.mark.timeout(400)]
PHASE_S = 5.0
ROUNDS = 3
KEEPING_UP, STANDING, GARBAGE = 6, 1, 3
"""Ten visitors of a console that has room for eight."""
MOST_PERCENT = 5.0
"""Of a core, for one page."""
MOST_MB = 130.0
"""101 to 113 MB were seen, of which importing the command line takes 68."""


@dataclass
class Measured:
    """Commands and the console's CPU while so many visited."""

    one_way_ms: list[float] = field(default_factory=list)
    cpu_s: float = 0.0
    wall_s: float = 0.0

    @property
    def percent(self) -> float:
        return 100.0 * self.cpu_s / self.wall_s

    def quantile(self, share: float) -> float:
        return float(np.quantile(self.one_way_ms, share))


class OneWays:
    """Put→received of each command that the robot tells of."""

    def __init__(self, rig: Rig) -> None:
        self.into: Measured | None = None
        self._newest = -1
        rig.observer.listeners.append(self._take)

    def _take(self, message: Heard) -> None:
        if (
            not isinstance(message, RobotState)
            or message.echo is None
            or message.echo.sequence == self._newest
        ):
            return
        self._newest = message.echo.sequence
        took_ns = one_way_ns(message.echo.put_ns, message.echo.received_ns, master_offset(message))
        if self.into is not None and took_ns is not None:
            self.into.one_way_ms.append(to_ms(took_ns))


async def measure(rig: Rig, console: ConsoleChild, ways: OneWays, into: Measured) -> None:
    """For `PHASE_S`, after a second in which the visitors settle."""
    await rig.until(later(1.0), 5.0, "a second")
    usage, began_ns = console.child.usage, monotonic_ns()
    assert usage is not None
    ways.into = into
    await rig.until(later(PHASE_S), 3.0 * PHASE_S, "states")
    ways.into = None
    after = console.child.usage
    assert after is not None
    into.cpu_s += after.cpu_s - usage.cpu_s
    into.wall_s += to_s(monotonic_ns() - began_ns)


def later(seconds: float) -> Callable[[], bool]:
    """Becomes true after so long."""
    at_ns = monotonic_ns() + to_ns(seconds)
    return lambda: monotonic_ns() >= at_ns


@asynccontextmanager
async def visitors(url: str, count: int, behaviour: str) -> AsyncIterator[asyncio.subprocess.Process]:
    """A process of them, all of which see the page."""
    process = await asyncio.create_subprocess_exec(
        sys.executable, "-m", "tests.deploy.console.visitors", url, str(count), behaviour,
        stdout=asyncio.subprocess.PIPE, stderr=asyncio.subprocess.DEVNULL,
    )  # fmt: skip
    try:
        assert process.stdout is not None
        for _ in range(count):
            assert await asyncio.wait_for(process.stdout.readline(), 30.0) == b"sees\n"
        yield process
    finally:
        if process.returncode is None:
            process.kill()
        await process.wait()


def report(measured: dict[str, Measured], console: ConsoleChild) -> None:
    """The figures, for those who read the output."""
    for name, one in measured.items():
        print(  # noqa: T201
            f"{name}: put→received p50 {one.quantile(0.5):.2f}, p90 {one.quantile(0.9):.2f}, "
            f"p99 {one.quantile(0.99):.2f} ms of {len(one.one_way_ms)}; console {one.percent:.1f} % of a core"
        )
    usage = console.child.usage
    print(f"console: {usage.rss_mb if usage else 0.0:.0f} MB")  # noqa: T201


def test_ten_visitors_of_whom_some_stand_still_or_send_garbage_delay_no_command(
    on_this_host: OnThisHost, tmp_path: Path
) -> None:
    async def story(host: HostWatch) -> None:
        folder = tmp_path / str(monotonic_ns())
        folder.mkdir()
        measured = {name: Measured() for name in ("nobody", "one page", "ten visitors")}
        overrides = {"master": [f'tap.socket="{folder / "master.sock"}"']}
        async with open_rig(overrides=overrides) as rig:
            await start_all(rig)
            console, ways = ConsoleChild(rig), OneWays(rig)
            await console.start()
            url = console.address.rstrip("/")
            await until_tracking(rig, ROBOT)
            for _ in range(ROUNDS):
                await measure(rig, console, ways, measured["nobody"])
                async with visitors(url, 1, "keep up"):
                    await measure(rig, console, ways, measured["one page"])
                async with (
                    visitors(url, KEEPING_UP, "keep up"),
                    visitors(url, STANDING, "keep up") as standing,
                    visitors(url, GARBAGE, "garbage"),
                ):
                    standing.send_signal(signal.SIGSTOP)
                    await measure(rig, console, ways, measured["ten visitors"])
                    standing.send_signal(signal.SIGCONT)
            report(measured, console)
            usage = console.child.usage
            assert usage is not None
            assert "Traceback" not in console.child.log_text()
        quiet, one, many = measured.values()
        assert min(len(each.one_way_ms) for each in measured.values()) > 100
        assert many.quantile(0.5) <= 1.25 * quiet.quantile(0.5) + 0.1
        assert many.quantile(0.9) <= 2.0 * quiet.quantile(0.9) + 1.0
        assert one.percent <= MOST_PERCENT
        assert usage.rss_mb <= MOST_MB

    on_this_host(story)
