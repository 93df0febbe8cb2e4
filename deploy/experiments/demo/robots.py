"""How each robot of a run fared: a row a robot, as plain values and as a table for people."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rich.console import Group, RenderableType
from rich.text import Text

from common.metrics.slave import SlaveMetrics
from deploy.experiments.demo.plain import tree_or_none
from deploy.experiments.demo.tables import holds_text, ticks_text
from deploy.harness.child import Child
from deploy.harness.observer import Observer
from deploy.measure import TruthSeries, motion
from deploy.report.tables import UNKNOWN, number, plain_table


def robot_row(observer: Observer, child: Child, truth: TruthSeries) -> dict[str, Any]:
    """One of a report's `robots`."""
    metrics = child.metrics(SlaveMetrics)
    guard = metrics.guard if metrics else None
    moved = motion(truth, observer.trace.moved(), observer.trace.joint_names)
    tracked = [state.guard == "track" for state in observer.states]
    # the way to the operator's posture does not count
    since = tracked[tracked.index(True) :] if any(tracked) else []
    return {
        "in_track": sum(since) / len(since) if since else 0.0,
        "ticks": tree_or_none(metrics and metrics.ticks),
        "received": guard.received if guard else None,
        "accepted": guard.accepted if guard else None,
        "dropped": guard.dropped if guard else None,
        "losses": guard.losses if guard else None,
        "one_way_ms": tree_or_none(metrics and metrics.one_way_ms),
        "one_way_corrected_ms": tree_or_none(metrics and metrics.one_way_corrected_ms),
        "due": tree_or_none(metrics and metrics.due),
        "end_to_end_ms": tree_or_none(metrics and metrics.end_to_end_ms),
        "rmse_deg": moved.rmse_deg if moved else None,
        "motion_lag_ms": moved.lag_ms if moved else None,
        "cpu_percent": round(child.cpu_percent, 1),
        "rss_mb": round(child.rss_mb, 1),
    }


def robot_problems(robot: str, row: Mapping[str, Any]) -> list[str]:
    """Why a run counts as failed because of this robot."""
    problems = []
    if row["received"] is None:
        problems.append(f"{robot} left no metrics")
    elif not row["received"]:
        problems.append(f"no command reached {robot}: it was not judged")
    if row["in_track"] == 0.0:
        problems.append(f"{robot} never reached track")
    return problems


def robots_table(tree: Mapping[str, Any]) -> RenderableType:
    """One row a robot, then the master; from a report's tree."""
    table = plain_table("robot", "track", "missed", "ticks", "CPU %", "one way", "whole p99", "RMSE °", "lag")
    robots: Mapping[str, Mapping[str, Any]] = tree["robots"]
    for robot, row in robots.items():
        ticks = row["ticks"] or {}
        table.add_row(
            robot,
            f"{row['in_track']:.0%}",
            str(ticks.get("missed", UNKNOWN)),
            str(ticks.get("expected", UNKNOWN)),
            f"{row['cpu_percent']:.0f}",
            number((row["one_way_ms"] or {}).get("p99"), 1),
            number((row["end_to_end_ms"] or {}).get("p99"), 1),
            number(row["rmse_deg"], 2),
            number(row["motion_lag_ms"], 0),
        )
    loops = {"master": tree["ticks"]}
    missed = {robot: row["ticks"]["missed"] for robot, row in robots.items() if row["ticks"]}
    if missed:
        slowest = max(missed, key=lambda robot: int(missed[robot]))
        loops[slowest] = robots[slowest]["ticks"]
    text = Text(_master_words(tree) + _missing_words(robots), "dim")
    return Group(table, text, ticks_text(loops, tree["host"]), holds_text(tree["holds"]))


def _master_words(tree: Mapping[str, Any]) -> str:
    put_ms = number((tree["frames_in_to_put_ms"] or {}).get("p99"), 2)
    cpu = tree["cpu_percent"]["master"]
    return f"master: {cpu:.0f} % of a core, last frame in → put p99 {put_ms} ms; times in ms, p99"


def _missing_words(robots: Mapping[str, Mapping[str, Any]]) -> str:
    missing = {robot: row["due"]["missing"] for robot, row in robots.items() if row["due"] is not None}
    named = ", ".join(f"{robot} {count}" for robot, count in missing.items() if count)
    return f"; commands missing when due: {named}" if named else ""
