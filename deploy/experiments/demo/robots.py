"""How each robot of a run fared: a row a robot."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from rich.table import Table

from common.metrics.parts import Summary, Ticks
from common.metrics.slave import DueMetrics, SlaveMetrics
from deploy.harness.child import Child
from deploy.harness.observer import Observer
from deploy.measure import TruthSeries, motion
from deploy.report.tables import UNKNOWN, number, plain_table


@dataclass(frozen=True, slots=True)
class RobotRow:
    """One of a report's `robots`. What its process counts is None where it left no metrics."""

    in_track: float
    """Share of the states since it first tracked."""
    ticks: Ticks | None
    received: int | None
    """Commands; so are the next two."""
    accepted: int | None
    dropped: Mapping[str, int] | None
    losses: Mapping[str, int] | None
    one_way_ms: Summary | None
    one_way_corrected_ms: Summary | None
    due: DueMetrics | None
    end_to_end_ms: Summary | None
    rmse_deg: float | None
    motion_lag_ms: float | None
    cpu_percent: float
    rss_mb: float


def robot_row(observer: Observer, child: Child, truth: TruthSeries) -> RobotRow:
    """Judge one robot of a finished run."""
    metrics = child.metrics(SlaveMetrics)
    guard = metrics.guard if metrics else None
    moved = motion(truth, observer.trace.moved(), observer.trace.joint_names)
    tracked = [state.guard == "track" for state in observer.states]
    # the way to the operator's posture does not count
    since = tracked[tracked.index(True) :] if any(tracked) else []
    return RobotRow(
        in_track=sum(since) / len(since) if since else 0.0,
        ticks=metrics.ticks if metrics else None,
        received=guard.received if guard else None,
        accepted=guard.accepted if guard else None,
        dropped=guard.dropped if guard else None,
        losses=guard.losses if guard else None,
        one_way_ms=metrics.one_way_ms if metrics else None,
        one_way_corrected_ms=metrics.one_way_corrected_ms if metrics else None,
        due=metrics.due if metrics else None,
        end_to_end_ms=metrics.end_to_end_ms if metrics else None,
        rmse_deg=moved.rmse_deg if moved else None,
        motion_lag_ms=moved.lag_ms if moved else None,
        cpu_percent=round(child.cpu_percent, 1),
        rss_mb=round(child.rss_mb, 1),
    )


def robot_problems(robot: str, row: RobotRow) -> list[str]:
    """Why a run counts as failed because of this robot."""
    problems = []
    if row.received is None:
        problems.append(f"{robot} left no metrics")
    elif not row.received:
        problems.append(f"no command reached {robot}: it was not judged")
    if row.in_track == 0.0:
        problems.append(f"{robot} never reached track")
    return problems


def robots_table(robots: Mapping[str, RobotRow]) -> Table:
    """One row a robot."""
    table = plain_table("robot", "track", "missed", "ticks", "CPU %", "one way", "whole p99", "RMSE °", "lag")
    for robot, row in robots.items():
        table.add_row(
            robot,
            f"{row.in_track:.0%}",
            str(row.ticks.missed) if row.ticks else UNKNOWN,
            str(row.ticks.expected) if row.ticks else UNKNOWN,
            f"{row.cpu_percent:.0f}",
            number(row.one_way_ms.p99 if row.one_way_ms else None, 1),
            number(row.end_to_end_ms.p99 if row.end_to_end_ms else None, 1),
            number(row.rmse_deg, 2),
            number(row.motion_lag_ms, 0),
        )
    return table
