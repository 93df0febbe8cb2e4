"""How each of many robots fared beside the others: one plain tree, and a row a robot for people."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from rich.console import Group, RenderableType
from rich.text import Text

from common.metrics.master import MasterMetrics
from common.metrics.slave import SlaveMetrics
from deploy.experiments.demo.report import Seen, tree_or_none, trees
from deploy.harness.observer import Observer
from deploy.harness.rig import Rig
from deploy.measure import TruthSeries, motion
from deploy.measure.tables import UNKNOWN, holds_text, plain_table, ticks_text

if TYPE_CHECKING:
    from deploy.experiments.demo.run import DemoOptions
    from deploy.harness.child import Child


@dataclass(frozen=True, slots=True)
class ManyReport:
    """Figures by robot and of the master, and why the run counts as failed."""

    tree: dict[str, Any]
    problems: list[str] = field(default_factory=list)


def make_many_report(
    options: DemoOptions, rig: Rig, statuses: Mapping[str, int | None], seen: Seen
) -> ManyReport:
    """Judge a finished run from what was observed and what the processes counted."""
    problems = [f"{name} ended with status {status}" for name, status in statuses.items() if status != 0]
    truth = rig.observer.trace.truth()
    robots = {
        robot: _robot(observer, rig.children[slave], truth)
        for slave, (robot, observer) in zip(rig.slaves, rig.observers.items(), strict=True)
    }
    for robot, one in robots.items():
        if one["in_track"] == 0.0:
            problems.append(f"{robot} never reached track")
        if one["received"] is None:
            problems.append(f"{robot} left no figures")
        elif not one["received"]:
            problems.append(f"no command reached {robot}: nothing of it was judged")
    if seen.problem:
        problems.append(seen.problem)
    master = rig.children["master"]
    counted = master.metrics(MasterMetrics)
    if counted is None:
        problems.append("the master left no figures")
    tree = {
        "options": {"profile": options.profile, "seconds": options.seconds, "transport": options.transport},
        "master": {
            "ticks": tree_or_none(counted and counted.ticks),
            "frames_in_to_put_ms": tree_or_none(counted and counted.frames_in_to_put_ms),
            "cpu_percent": round(master.cpu_percent, 1),
            "rss_mb": round(master.rss_mb, 1),
            "robots": trees(counted.robots if counted else {}),
        },
        "robots": robots,
        "host": seen.host,
        "holds": seen.holds,
        "cpu_percent": {name: round(child.cpu_percent, 1) for name, child in rig.children.items()},
        "exit_status": dict(statuses),
        "problems": problems,
    }
    return ManyReport(tree, problems)


def _robot(observer: Observer, child: Child, truth: TruthSeries) -> dict[str, Any]:
    counted = child.metrics(SlaveMetrics)
    guard = counted.guard if counted else None
    moved = motion(truth, observer.trace.moved(), observer.trace.joint_names)
    tracked = [state.guard == "track" for state in observer.states]
    # the way to the operator's posture is none of it
    since = tracked[tracked.index(True) :] if any(tracked) else []
    return {
        "in_track": sum(since) / len(since) if since else 0.0,
        "ticks": tree_or_none(counted and counted.ticks),
        "received": guard.received if guard else None,
        "accepted": guard.accepted if guard else None,
        "dropped": guard.dropped if guard else None,
        "losses": guard.losses if guard else None,
        "one_way_ms": tree_or_none(counted and counted.one_way_ms),
        "one_way_corrected_ms": tree_or_none(counted and counted.one_way_corrected_ms),
        "due": tree_or_none(counted and counted.due),
        "end_to_end_ms": tree_or_none(counted and counted.end_to_end_ms),
        "rmse_deg": moved.rmse_deg if moved else None,
        "motion_lag_ms": moved.lag_ms if moved else None,
        "cpu_percent": round(child.cpu_percent, 1),
        "rss_mb": round(child.rss_mb, 1),
    }


def many_table(tree: Mapping[str, Any]) -> RenderableType:
    """One row a robot, then the master."""
    table = plain_table("robot", "track", "missed", "ticks", "CPU %", "one way", "whole p99", "RMSE °", "lag")
    for robot, one in tree["robots"].items():
        table.add_row(
            robot,
            f"{one['in_track']:.0%}",
            str((one["ticks"] or {}).get("missed", UNKNOWN)),
            str((one["ticks"] or {}).get("expected", UNKNOWN)),
            f"{one['cpu_percent']:.0f}",
            _number((one["one_way_ms"] or {}).get("p99"), 1),
            _number((one["end_to_end_ms"] or {}).get("p99"), 1),
            _number(one["rmse_deg"], 2),
            _number(one["motion_lag_ms"], 0),
        )
    master, ticks = tree["master"], tree["master"]["ticks"]
    put_ms = _number((master["frames_in_to_put_ms"] or {}).get("p99"), 2)
    text = (
        f"master: {master['cpu_percent']:.0f} % of a core, last frame in → put p99 {put_ms} ms; "
        "times in ms, p99"
    )
    ours = {robot: one["ticks"] for robot, one in tree["robots"].items()}
    known = {robot: ticks["missed"] for robot, ticks in ours.items() if ticks}
    slowest = max(known, key=lambda robot: int(known[robot]), default="")
    loops = {"master": ticks, **({slowest: ours[slowest]} if slowest else {})}
    gone = {name: due["missing"] for name, one in tree["robots"].items() if (due := one["due"]) is not None}
    if any(gone.values()):
        named = ", ".join(f"{name} {count}" for name, count in gone.items() if count)
        text += f"; commands not there when they were due: {named}"
    return Group(table, Text(text, "dim"), ticks_text(loops, tree["host"]), holds_text(tree["holds"]))


def _number(value: float | None, digits: int) -> str:
    return UNKNOWN if value is None else f"{value:.{digits}f}"
