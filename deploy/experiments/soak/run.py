"""The story of a soak: start, follow, bring one fault after the other, engage again each time, stop."""

from __future__ import annotations

import asyncio
import math
import random
from contextlib import suppress
from dataclasses import asdict, replace
from pathlib import Path

import psutil
from rich.live import Live

from common.clock import NS_PER_MS, monotonic_ns, to_ns, to_s
from common.errors import TandemError
from common.process.heap import freeze_heap, reserve_heap
from common.process.pacing import TickGrid
from common.process.ticker import ticks
from common.wire.messages import Action
from deploy.experiments.soak import recorder as recording
from deploy.experiments.soak.faults import FAULTS, FaultCase, SoakFault, possible
from deploy.experiments.soak.files.happenings import (
    FaultBegun,
    FaultRecovered,
    FaultUndone,
    HostStalled,
    ProcessEnded,
    RobotFollowed,
    RobotLeft,
    SoakBegun,
)
from deploy.experiments.soak.files.log import SoakLog
from deploy.experiments.soak.files.options import SoakOptions
from deploy.experiments.soak.link import LinkLosses, nature
from deploy.experiments.soak.progress import SoakProgress
from deploy.experiments.soak.recovery import SoakOperator
from deploy.experiments.soak.schedule import distance_s, schedule
from deploy.experiments.soak.stage import Stage
from deploy.experiments.soak.view import draw
from deploy.harness.child import Usage, usage
from deploy.harness.host import HostWatch
from deploy.harness.start import start_all

SOAK = "soak"
"""The name of this process among those that are watched."""
START_S = 90.0
LOOK_S = 0.05
STEADY_S = 3.0
"""The robot follows at least so long between two faults."""
MOST_ENDS = 5
"""A process that ends by itself more often is not started again."""


class Soak:
    """One soak. `run` returns when its time is over; it may be cancelled at any moment."""

    def __init__(self, options: SoakOptions, stage: Stage, log: SoakLog, host: HostWatch, live: Live) -> None:
        self._options = options
        self._stage = stage
        self._log = log
        self._host = host
        self._live = live
        self._operator = SoakOperator(stage)
        self._ends: dict[str, int] = {}
        self._self = psutil.Process()
        self._losses = LinkLosses(stage.rig.network)
        self.progress = SoakProgress(options.duration_s)

    async def run(self) -> None:
        """Raises TandemError where it cannot begin, or a process ends again and again."""
        sampling = asyncio.create_task(self._sample())
        injecting = asyncio.create_task(self._story())
        try:
            done, _ = await asyncio.wait({sampling, injecting}, return_when=asyncio.FIRST_COMPLETED)
            for task in done:
                task.result()
        finally:
            for task in (sampling, injecting):
                task.cancel()
                with suppress(asyncio.CancelledError, TandemError):
                    await task

    async def _story(self) -> None:
        kinds, left_out = await possible(self._options.faults, self._stage)
        every_s = self._options.every_s or distance_s(self._options.duration_s, len(kinds))
        network = self._stage.rig.network
        begun = {**asdict(self._options), "every_s": every_s, "faults": tuple(kinds), "left_out": left_out}
        self._log.add(SoakBegun(**begun, network=nature(network.profile) if network else None))
        await self._start()
        enders = [name for name in kinds if FAULTS[name].ends_process]
        planned = schedule(self._options.duration_s, kinds, enders, every_s, self._options.seed)
        began_s = self._log.now_s
        self.progress.began_s, self.progress.planned = began_s, planned
        self.progress.busy = ""
        self._log.add(RobotFollowed(len(planned)))
        freeze_heap()
        reserve_heap()
        for number, one in enumerate(planned):
            await self._tend(began_s + one.at_s)
            self.progress.next = number + 1
            await self._bring(FAULTS[one.fault], number)
        await self._tend(began_s + self._options.duration_s)
        await self._end()

    async def _start(self) -> None:
        stage = self._stage
        # a process that ends by itself is started again, also now
        await start_all(stage.rig, START_S, check=lambda: None, start=stage.start)
        await stage.start(recording.NAME)
        recovery = await self._operator.recover(monotonic_ns())
        if not recovery.done:
            waiting = stage.rig.observer.waiting_for()
            raise TandemError(f"the robot never followed: {recovery.refused or waiting}")

    async def _tend(self, until_s: float) -> None:
        """Let it run; a robot that stops following by itself is noted, and engaged again."""
        steady_s = self._log.now_s + STEADY_S
        while self._log.now_s < max(until_s, min(steady_s, until_s + STEADY_S)):
            if not self._operator.follows and not await self._soon():
                await self._recover_unplanned()
                steady_s = self._log.now_s + STEADY_S
            await asyncio.sleep(LOOK_S)

    async def _soon(self) -> bool:
        """Whether it follows again at once: a single late command is not noted."""
        for _ in range(10):
            await asyncio.sleep(LOOK_S)
            if self._operator.follows:
                return True
        return False

    async def _recover_unplanned(self) -> None:
        watch, state = self._stage.watch, self._stage.watch.state
        guard = watch.guard(monotonic_ns())
        self._log.add(RobotLeft(guard, state.reason if state else "", watch.known()))
        self.progress.busy = "the robot stopped following by itself"
        recovery = await self._operator.recover(monotonic_ns())
        self._log.add(FaultRecovered(**asdict(recovery)))
        self.progress.busy = ""

    async def _bring(self, fault: SoakFault, number: int) -> None:
        """One fault from its begin until the robot follows again."""
        watch, log = self._stage.watch, self._log
        self.progress.busy = fault.words
        case = FaultCase(self._stage, random.Random(f"{self._options.seed} {number}"))
        lasts_s = case.draw.uniform(*fault.lasts_s)
        course = fault.course(number, log.now_s)
        log.add(FaultBegun(**asdict(course), lasts_s=lasts_s))
        begun_ns = monotonic_ns()
        robot_ns = watch.motion.newest_ns() + begun_ns - watch.state_ns
        try:
            await fault.begin(case)
            await asyncio.sleep(lasts_s)
            if fault.lives:
                stands_s = watch.motion.standstill_s(robot_ns) if fault.holds else None
                course = replace(course, held_s=_since(begun_ns, watch.held_ns), stands_s=stands_s)
            await fault.end(case)
        except TandemError as error:
            course = replace(course, failed=str(error))
        undone_ns = monotonic_ns()
        course = replace(course, step_s=case.step_s, node=case.node, disk=case.disk)
        log.add(FaultUndone(**asdict(course)))
        recovery = await self._operator.recover(undone_ns)
        log.add(FaultRecovered(**asdict(course), **asdict(recovery)))
        self.progress.busy = ""

    async def _end(self) -> None:
        self.progress.busy = "stopping"
        with suppress(TandemError):
            await self._stage.rig.control(Action.DISENGAGE)

    # what is looked at once a second

    async def _sample(self) -> None:
        async for _ in ticks(TickGrid(monotonic_ns() + to_ns(1.0), to_ns(1.0))):
            row = self._stage.watch.row()
            row |= {"host_still_ms": self._stalls(), **self._losses.row()}
            for name, (life, used) in self._stage.usage().items():
                row |= _columns(name, life, used)
            used_here = usage(self._self)
            row |= _columns(SOAK, 1, used_here) if used_here else {}
            strayed_rad = self._stage.watch.motion.take_strayed()
            if strayed_rad is not None:
                row["strayed_deg"] = math.degrees(strayed_rad)
            self._log.sample(row)
            await self._look_after_processes()
            self._live.update(draw(self.progress, self._stage, self._log, row))

    def _stalls(self) -> float:
        """The longest stall since the last call that the host is shown to have caused, ms."""
        longest_s = 0.0
        for stall in self._host.stalls:
            still_s = to_s(stall.until_ns - stall.from_ns)
            longest_s = max(longest_s, to_s(stall.excused_ns))
            if still_s >= 0.02:
                from_s, excused_ms = self._log.at_s(stall.from_ns), stall.excused_ns / NS_PER_MS
                self._log.add(HostStalled(from_s, 1e3 * still_s, excused_ms, str(stall.evidence)))
        self._host.stalls.clear()
        return 1e3 * longest_s

    async def _look_after_processes(self) -> None:
        for name in self._stage.ended():
            child = self._stage.children[name]
            self._log.add(ProcessEnded(name, child.last_lines()))
            self._ends[name] = self._ends.get(name, 0) + 1
            if self._ends[name] > MOST_ENDS:
                raise TandemError(f"the {name} ends again and again: {child.last_lines()}")
            await self._stage.start(name)


def _since(begun_ns: int, at_ns: int) -> float | None:
    return to_s(at_ns - begun_ns) if at_ns > begun_ns else None


def _columns(name: str, life: int, used: Usage) -> dict[str, float | str]:
    return {
        f"{name}_life": float(life),
        f"{name}_rss_mb": used.rss_mb,
        f"{name}_fds": float(used.fds),
        f"{name}_threads": float(used.threads),
        f"{name}_cpu_s": used.cpu_s,
    }


def folder_for(report: Path | None, temporary: Path) -> Path:
    """The folder that a soak writes to: the chosen one, which must be empty, or a temporary one."""
    if report is None:
        return temporary
    try:
        report.mkdir(parents=True, exist_ok=True)
        if any(report.iterdir()):
            raise TandemError(f"{report}: is not empty; name a new folder, so that no soak is written over")
    except OSError as error:
        raise TandemError(f"{report}: cannot be a report's folder ({error.strerror})") from None
    return report
