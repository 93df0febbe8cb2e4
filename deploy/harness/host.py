"""Detects stalls of the host: a virtual machine may lose its cores, whatever its programs do."""

from __future__ import annotations

import asyncio
import sys
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass, field, replace

import psutil
from pydantic import TypeAdapter

from common.clock import monotonic_ns, to_s
from common.metrics.parts import Ticks
from deploy.harness.excuse import LoopsBegan, Lost, Stall, lost, lost_before
from deploy.harness.reference_loop import PERIOD_NS

START_S = 10.0
"""A host on which a reference loop does not start within this long is not measured."""
STOP_S = 1.0
_LINE: TypeAdapter[LoopsBegan | Stall] = TypeAdapter(LoopsBegan | Stall)


@dataclass(frozen=True, slots=True)
class HostMetrics:
    """A report's `host`: what the host itself missed during a run."""

    ticks: Ticks
    """The ticks of the reference loop on the worst core."""
    longest_ms: float
    """The longest stall of any core."""
    priority: bool
    """Whether the loops had real-time priority."""
    steal_percent: float


@dataclass(slots=True)
class HostWatch:
    """What the reference loops have reported so far. Where they do not run, nothing is excused."""

    stalls: list[Stall] = field(default_factory=list)
    known_ns: dict[int, int] = field(default_factory=dict)
    """Up to when each core has reported."""
    began_ns: int = 0
    """When the loops began to tick; 0 where they did not."""
    priority: bool = False
    """Whether the loops run before tandem's programs. If not, tandem's load may make them late too, and only
    the stolen part of a stall excuses."""
    cpu_s: tuple[float, float] = (0.0, 0.0)
    """Stolen time and total time of all cores when the loops began."""

    _reported: asyncio.Event = field(default_factory=asyncio.Event)

    def take(self, line: str) -> None:
        """Take one line of the loops' output."""
        self._reported.set()
        report = _LINE.validate_json(line)
        if isinstance(report, LoopsBegan):
            self.began_ns, self.priority, self.cpu_s = report.origin_ns, report.priority, _cpu_s()
            self.known_ns = dict.fromkeys(report.cores, self.began_ns)
            return
        stall = replace(report, priority=self.priority)
        self.known_ns[stall.core] = stall.until_ns
        if stall.missed:
            self.stalls.append(stall)

    def end(self) -> None:
        """The loops have ended: `known` waits no longer."""
        self.known_ns.clear()
        self._reported.set()

    def stood_still_s(self, since_ns: int, until_ns: int) -> float:
        """The longest single stall of any core, as far as it lies between the two times."""
        spans = (min(s.until_ns, until_ns) - max(s.from_ns, since_ns) for s in reversed(self.stalls))
        return to_s(max(0, max(spans, default=0)))

    def lost(self, since_ns: int, until_ns: int) -> Lost:
        """What the host lost between the two, with the evidence."""
        return lost(self.stalls, since_ns, until_ns)

    def lost_before(self, at_ns: int, since_ns: int = 0) -> Lost:
        """What the host lost just before something happened."""
        return lost_before(self.stalls, at_ns, since_ns)

    async def known(self, until_ns: int) -> None:
        """Wait until every core has reported up to then; return at once where nothing is measured."""
        while min(self.known_ns.values(), default=until_ns) < until_ns:
            self._reported.clear()
            await self._reported.wait()

    async def excuse(self, since_ns: int) -> str:
        """Why a trial from then to now does not count, with the evidence; empty where it counts.

        The evidence shows a stall within this time that is long enough to make a guard hold.
        """
        now_ns = monotonic_ns()
        await self.known(now_ns)
        within = [stall.until_ns for stall in self.stalls if stall.until_ns >= since_ns]
        found = (self.lost_before(min(until_ns, now_ns), since_ns) for until_ns in within)
        return next((str(each) for each in found if each.explains_hold), "")

    @property
    def missed(self) -> int:
        """Ticks that the worst core's loop missed."""
        counts: dict[int, int] = {}
        for stall in self.stalls:
            counts[stall.core] = counts.get(stall.core, 0) + stall.missed
        return max(counts.values(), default=0)

    def metrics(self, now_ns: int) -> HostMetrics | None:
        """For a report; None where nothing was measured."""
        if not self.began_ns:
            return None
        return HostMetrics(
            ticks=Ticks(max(0, now_ns - self.began_ns) // PERIOD_NS, self.missed),
            longest_ms=round(1e3 * self.stood_still_s(self.began_ns, now_ns), 1),
            priority=self.priority,
            steal_percent=round(self._steal_percent(), 1),
        )

    def _steal_percent(self) -> float:
        steal_s, all_s = (now - before for now, before in zip(_cpu_s(), self.cpu_s, strict=True))
        return 100.0 * steal_s / all_s if all_s > 0.0 else 0.0


def _cpu_s() -> tuple[float, float]:
    times = psutil.cpu_times()
    return getattr(times, "steal", 0.0), sum(times[:8])


@asynccontextmanager
async def watch_host() -> AsyncIterator[HostWatch]:
    """Run reference loops on every core during the block; the HostWatch collects what they report."""
    host = HostWatch()
    process = await asyncio.create_subprocess_exec(
        sys.executable, "-m", "deploy.harness.reference_loop",
        stdin=asyncio.subprocess.PIPE, stdout=asyncio.subprocess.PIPE, stderr=asyncio.subprocess.DEVNULL,
    )  # fmt: skip
    stdin, stdout = process.stdin, process.stdout
    assert stdin is not None
    assert stdout is not None
    begun = asyncio.Event()

    async def listen() -> None:
        while line := await stdout.readline():
            host.take(line.decode())
            begun.set()
        host.end()
        begun.set()

    listening = asyncio.ensure_future(listen())
    try:
        with suppress(TimeoutError):
            await asyncio.wait_for(begun.wait(), START_S)
        yield host
    finally:
        stdin.close()
        try:
            await asyncio.wait_for(listening, STOP_S)
        except TimeoutError:
            with suppress(ProcessLookupError):
                process.kill()
        await process.wait()
