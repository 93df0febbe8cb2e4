"""Runs the cells of a fleet's bench and judges them. Open this file first."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager, ExitStack
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from statistics import median

import psutil

from common.clock import monotonic_ns
from deploy.experiments.bench.fleet.fit import WatchingCost, watching_cost
from deploy.experiments.bench.fleet.workers import NurseTask, nurse, robot_name, robots, router
from deploy.experiments.bench.run import machine
from deploy.experiments.bench.worker import beside, in_worker
from deploy.harness.endpoints import local_endpoints
from deploy.measure.verdict import Verdict, at_most

OWN_SESSIONS = 100
"""Up to so many robots each has a session of its own; more share them, ten to a session."""
SHARED = 10
PER_PROCESS, COMMANDED_PER_PROCESS = 500, 50
"""Robots in one process: states at 50 Hz cost more than summaries."""
WATCHED_LIMIT, COMMANDED_LIMIT, LINEAR_LIMIT = 5.0, 60.0, 20.0
"""Percent of a core; and percent by which the cost of a watched robot may grow with their number, or the cost
of watching differ from a line through all sizes."""
ENOUGH = 0.9
"""Of the messages that should come in a cell: with fewer its CPU time says nothing."""


@dataclass(frozen=True, slots=True)
class FleetCell:
    """One fleet to measure: `commanded` robots for each of `nurses` nurses, who watch all or none."""

    name: str
    robots: int
    commanded: int
    nurses: int = 1
    watches: bool = True


@dataclass(frozen=True, slots=True)
class MeasuredCell:
    """What a cell cost. Percent are of one core."""

    cell: FleetCell
    sessions: int
    """Of the robots, together."""
    core_percent: float
    """The first nurse's master."""
    each_nurse_percent: list[float]
    rss_mb: float
    states_hz: float
    summaries_hz: float
    commands_hz: float
    ready_s: float
    """Until all were listed and claimed."""
    router_percent: float
    """Beginnings included, as for the robots."""
    robots_percent: float
    measured: bool
    """Whether so many messages came that the figures are of this fleet."""
    core_percent_runs: list[float]


@dataclass(frozen=True, slots=True)
class FleetOptions:
    """What the command line asks for."""

    robots: int
    nurses: int
    seconds: float
    transport: str = "tcp"
    repeat: int = 1


@dataclass(frozen=True, slots=True)
class FleetReport:
    """The whole bench."""

    options: FleetOptions
    machine: Mapping[str, object]
    cells: list[MeasuredCell]
    verdicts: list[Verdict]

    def tree(self) -> dict[str, object]:
        """For a JSON file."""
        return {
            "options": asdict(self.options),
            "machine": dict(self.machine),
            "cells": [asdict(cell) for cell in self.cells],
            "verdicts": [verdict.tree() for verdict in self.verdicts],
        }


def cells(options: FleetOptions) -> list[FleetCell]:
    """What is measured."""
    most, nurses = options.robots, options.nurses
    few = min(most, 100)
    steps = [n for n in (10, 30, 100, 300, 1000, 3000) if n < most]
    return [
        FleetCell("nobody watched", 0, 0),
        *(FleetCell(f"{n} watched", n, 0) for n in [*steps, most]),
        FleetCell("1 commanded", 1, 1, watches=False),
        FleetCell(f"1 commanded + {few - 1} watched", few, 1),
        FleetCell(f"{few} commanded", few, few),
        *([FleetCell(f"{most} robots, {nurses} nurses", most, 1, nurses)] if nurses > 1 else []),
    ]


def measure_fleet(options: FleetOptions, folder: Path, tell: Callable[[str], None]) -> FleetReport:
    """Measure one cell after the other. Raises BenchError where a cell's processes fail."""
    measured = []
    for cell in cells(options):
        runs = []
        for turn in range(options.repeat):
            tell(f"{cell.name} ({turn + 1}/{options.repeat})")
            runs.append(_measure(cell, options, folder))
        measured.append(_middle(runs))
    return FleetReport(options, machine(), measured, judge(measured))


def _middle(runs: Sequence[MeasuredCell]) -> MeasuredCell:
    """The run whose cost is the median, with the costs of all."""
    costs = [run.core_percent for run in runs]
    chosen = min(runs, key=lambda run: abs(run.core_percent - median(costs)))
    return replace(chosen, core_percent_runs=costs)


def _measure(cell: FleetCell, options: FleetOptions, folder: Path) -> MeasuredCell:
    endpoint = local_endpoints(options.transport, folder, routed=True).router
    with ExitStack() as stack:
        pids = [stack.enter_context(beside(router, endpoint=endpoint))]
        pids += [stack.enter_context(each) for each in _robots(cell, endpoint)]
        tasks = [_task(cell, number, endpoint) for number in range(cell.nurses)]
        began_ns, before = monotonic_ns(), [_cpu_s(pid) for pid in pids]
        with ThreadPoolExecutor(cell.nurses) as pool:
            nurses = list(pool.map(lambda task: in_worker(nurse, options.seconds, task=task), tasks))
        elapsed_s, after = (monotonic_ns() - began_ns) * 1e-9, [_cpu_s(pid) for pid in pids]
    percent = [100.0 * (b - a) / elapsed_s for a, b in zip(before, after, strict=True)]
    first = nurses[0]
    return MeasuredCell(
        cell=cell,
        sessions=_sessions(cell.robots),
        core_percent=first["core_percent"],
        each_nurse_percent=[one["core_percent"] for one in nurses],
        rss_mb=first["rss_mb"],
        states_hz=first["states_hz"],
        summaries_hz=first["summaries_hz"],
        commands_hz=first["commands_hz"],
        ready_s=first["ready_s"],
        router_percent=percent[0],
        robots_percent=sum(percent[1:]),
        measured=_enough(cell, first),
        core_percent_runs=[],
    )


def _task(cell: FleetCell, number: int, endpoint: str) -> NurseTask:
    own = tuple(robot_name(number * cell.commanded + i) for i in range(cell.commanded))
    return NurseTask(endpoint, number, own, cell.robots if cell.watches else 0)


def _robots(cell: FleetCell, endpoint: str) -> Iterator[AbstractContextManager[int]]:
    most = COMMANDED_PER_PROCESS if cell.commanded > 1 else PER_PROCESS
    for first in range(0, cell.robots, most):
        count = min(most, cell.robots - first)
        sessions = max(1, _sessions(cell.robots) * count // cell.robots)
        yield beside(robots, endpoint=endpoint, first=first, count=count, sessions=sessions)


def _sessions(count: int) -> int:
    return count if count <= OWN_SESSIONS else max(OWN_SESSIONS, math.ceil(count / SHARED))


def _cpu_s(pid: int) -> float:
    times = psutil.Process(pid).cpu_times()
    return times.user + times.system


def _enough(cell: FleetCell, figures: Mapping[str, float]) -> bool:
    expected = {"states_hz": 50.0 * cell.commanded, "summaries_hz": float(cell.robots * cell.watches)}
    return all(figures[key] >= ENOUGH * rate for key, rate in expected.items())


def judge(measured: Sequence[MeasuredCell]) -> list[Verdict]:
    """The targets of a fleet. What was not measured at that size is not judged."""
    cost = {one.cell.name: one.core_percent for one in measured if one.measured}
    alone, beside_others = cost.get("1 commanded"), cost.get("1 commanded + 99 watched")
    above = None if alone is None or beside_others is None else beside_others - alone
    line = watching(measured)
    return [
        at_most("1 commanded + 99 watched, above one robot alone", above, WATCHED_LIMIT, "% of a core"),
        at_most("100 commanded", cost.get("100 commanded"), COMMANDED_LIMIT, "% of a core"),
        at_most("cost per watched robot grows by", growth_percent(measured), LINEAR_LIMIT, "%"),
        at_most(
            "watching: from fixed + each × N", line.furthest_percent if line else None, LINEAR_LIMIT, "%"
        ),
    ]


def watching(measured: Sequence[MeasuredCell]) -> WatchingCost | None:
    """The line through the fleets that are only watched; None where too few were measured."""
    cells = [one for one in measured if one.measured and not one.cell.commanded]
    return watching_cost({one.cell.robots: one.core_percent for one in cells})


def growth_percent(measured: Sequence[MeasuredCell]) -> float | None:
    """By how much the cost of a watched robot, above that of watching none, grows with their number, in %.

    From 100 robots on: ten robots cost less than what two runs of the same fleet differ by. It falls where
    several messages are taken at one waking; only a rise counts.
    """
    only_watched = [one for one in measured if one.measured and not one.cell.commanded]
    watched = {one.cell.robots: one.core_percent for one in only_watched}
    nobody = watched.pop(0, None)
    if nobody is None:
        return None
    each = [(cost - nobody) / count for count, cost in sorted(watched.items()) if count >= 100]
    if len(each) < 2 or min(each) <= 0.0:
        return None
    return 100.0 * max(later / sooner - 1.0 for i, sooner in enumerate(each) for later in each[i + 1 :])
