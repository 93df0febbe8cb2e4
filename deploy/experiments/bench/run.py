"""All benches, one after another, then percent of a core and the verdicts. Open this file first."""

from __future__ import annotations

import os
import platform
from collections.abc import Callable
from dataclasses import dataclass

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
from rich.text import Text

from common.wire.topics import COMMAND
from deploy.experiments.bench.capture import capture
from deploy.experiments.bench.link import link, transports
from deploy.experiments.bench.loop import RATE_HZ, loop
from deploy.experiments.bench.pipeline import pipeline
from deploy.experiments.bench.robot import robot
from deploy.experiments.bench.table import bench_table, figures_at
from deploy.experiments.bench.targets import BENCH
from deploy.experiments.bench.worker import BenchError, in_worker
from deploy.measure.target import judge_targets
from deploy.measure.timing import total
from deploy.measure.verdict import verdict_table

QUICK = 0.12
"""Share of the time that each bench gets in quick mode."""


@dataclass(frozen=True, slots=True)
class _Bench:
    name: str
    path: tuple[str, ...]
    """Where its figures stand in the report."""
    seconds: float
    measure: Callable[[float], object]


BENCHES = (
    _Bench("loop, idle and beside a busy core", ("loop",), 12.0, loop),
    _Bench("capture, 36 FD nodes", ("capture", "nodes_36"), 5.0, lambda s: capture(s, 36, fd=True)),
    _Bench(
        "capture, 8 classic nodes", ("capture", "nodes_8_classic"), 3.0, lambda s: capture(s, 8, fd=False)
    ),
    _Bench("the master's steps", ("pipeline",), 10.0, lambda s: in_worker(pipeline, s)),
    _Bench("link beside Zenoh and UDP", ("link",), 12.0, link),
    _Bench("link over each transport", ("transports",), 12.0, transports),
    _Bench("robot", ("robot",), 2.0, lambda s: in_worker(robot, s)),
)


def bench(quick: bool, console: Console) -> dict[str, object]:
    """Run all benches and print their tables: below 60 s, or 15 s when quick, on a machine at rest.

    The report is plain JSON values: a key a bench, `core_percent`, `verdicts`, `machine` and `failed`.
    A bench that fails leaves its reason under `failed`, and the others go on.
    """
    failed: dict[str, str] = {}
    report: dict[str, object] = {"machine": machine(), "quick": quick, "failed": failed}
    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
    with Progress(*columns, console=console, transient=True) as progress:
        task = progress.add_task("bench", total=sum(b.seconds for b in BENCHES))
        for each in BENCHES:
            progress.update(task, description=each.name)
            try:
                figures = each.measure(each.seconds * (QUICK if quick else 1.0))
            except BenchError as error:
                failed[each.name] = str(error)
                figures = {}
            _put(report, each.path, figures)
            progress.advance(task, each.seconds)
    report["core_percent"] = shares = core_percent(report)
    judged = judge_targets(report, BENCH)
    report["verdicts"] = [verdict.tree() for verdict in judged]
    console.print(bench_table(report, shares))
    console.print(verdict_table("is this machine good enough?", judged))
    for name, reason in failed.items():
        console.print(Text(f"{name}: {reason}", "bold red"))
    return report


def machine() -> dict[str, object]:
    """What was measured on, and how busy it was before."""
    return {
        "cores": os.cpu_count(),
        "system": f"{platform.system()} {platform.release()}",
        "python": platform.python_version(),
        "load": round(os.getloadavg()[0], 2),
    }


def core_percent(report: dict[str, object]) -> dict[str, float | None]:
    """Percent of one core, from the benches' medians: the master by its steps, the simulated robot, both.

    None where a bench did not give its part.
    """
    a_command = total(_median(report, "pipeline", step) for step in ("joint_angles_us", "codec_us"))

    def master(captured: str, nodes: str) -> float | None:
        parts = (("capture", captured, "cpu_us"), ("pipeline", nodes, "orientation_us"))
        a_tick = total(_median(report, *part) for part in parts)
        if a_tick is None or a_command is None:
            return None
        return round(1e-4 * (RATE_HZ * a_tick + COMMAND.rate_hz * a_command), 2)

    of_36, of_robot = master("nodes_36", "nodes_36"), figures_at(report, "robot").get("core_percent")
    return {
        "master_36_nodes": of_36,
        "master_8_classic_nodes": master("nodes_8_classic", "nodes_8"),
        "robot": of_robot,
        "total": total((of_36, of_robot)),
    }


def _median(report: dict[str, object], *path: str) -> float | None:
    return figures_at(report, *path).get("median")


def _put(report: dict[str, object], path: tuple[str, ...], figures: object) -> None:
    *above, last = path
    for key in above:
        part = report.setdefault(key, {})
        assert isinstance(part, dict)
        report = part
    report[last] = figures
