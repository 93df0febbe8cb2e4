"""What a demo shows: the live view while it runs, the tables when it is over."""

from __future__ import annotations

import numpy as np
from rich.console import Console, Group, RenderableType
from rich.text import Text

from deploy.client.efforts import by_joint
from deploy.experiments.demo.live_view import Live, live_view
from deploy.experiments.demo.nearness import nearness_text
from deploy.experiments.demo.report import DemoReport
from deploy.experiments.demo.robots import robots_table
from deploy.experiments.demo.tables import (
    accuracy_table,
    holds_text,
    latency_table,
    motion_table,
    strategies_table,
    synergy_table,
    ticks_text,
    video_table,
)
from deploy.experiments.demo.targets import of_demo
from deploy.experiments.demo.tree import report_tree
from deploy.harness.rig import Rig
from deploy.measure.target import judge_targets
from deploy.measure.verdict import verdict_table
from deploy.report.tables import number


def draw(rig: Rig, host_missed: int, elapsed_s: float) -> RenderableType:
    """The live view of a running rig: the first robot, and of several each one's guard state."""
    observer = rig.observer
    master, slave = observer.master, observer.slave
    state = observer.state
    reason = state.reason if state else "not heard"
    if not observer.ready and observer.guard == "hold":
        reason = observer.waiting_for()
    video = slave.video if slave else None
    usage = {f"{role} CPU %": child.cpu_percent for role, child in rig.children.items()}
    view = live_view(
        Live(
            elapsed_s=elapsed_s,
            guard=observer.guard,
            reason=reason,
            rates_hz=observer.rates_hz,
            stages=slave.stages_ms if slave else {},
            joint_error_deg=_errors_deg(rig),
            effort_nm=(by_joint(state.effort_nm) if state else None) or {},
            drops={
                **({"ticks missed": master.ticks.missed} if master else {}),
                "by the host": host_missed,
                **(slave.guard.dropped if slave else {}),
            },
        )
    )
    words = [f"{name} {value:.0f}" for name, value in usage.items()]
    if video:
        words.append(video.fault or f"video {video.fps:.0f} Hz, {video.kb_s:.0f} kB/s")
    guards = [f"{robot} {one.guard}" for robot, one in rig.observers.items()]
    each = [Text("   ".join(guards))] if len(guards) > 1 else []
    return Group(view, *each, Text("   ".join(words), "dim"))


def print_report(report: DemoReport, console: Console) -> None:
    """Of one robot all tables, and the targets met or missed; of several a row each."""
    if len(report.robots) > 1:
        master = Text(_master_words(report), "dim")
        console.print(Group(robots_table(report.robots), master, _loops(report)))
        console.print(holds_text(report.notes.holds))
    else:
        _print_tables(report, console)


def _print_tables(report: DemoReport, console: Console) -> None:
    """Latency budget, accuracy beside the paper's, motion, and the targets met or missed."""
    console.print(latency_table(report.slave))
    if report.video is not None:
        console.print(video_table(report.video))
    if not any(report.accuracy.estimated.values()):
        console.print(Text("no truth to judge by: a recording has no true angles", "yellow"))
    else:
        console.print(accuracy_table(report.accuracy), motion_table(report.motion))
    if report.comparison is not None:
        console.print(strategies_table(report.comparison.as_run, report.comparison.replayed))
    if report.synergies:
        console.print(synergy_table(report.synergies))
    if report.nearness is not None:
        console.print(nearness_text(report.nearness))
    console.print(Group(_loops(report), holds_text(report.notes.holds)))
    targets = of_demo(report.options.profile, report.options.servos)
    console.print(verdict_table("targets", judge_targets(report_tree(report), targets)))


def _loops(report: DemoReport) -> RenderableType:
    """The master's missed ticks, those of the robot that missed most, and the host's."""
    rows = report.robots
    worst = max(rows, key=lambda robot: ticks.missed if (ticks := rows[robot].ticks) else -1)
    name = worst if len(rows) > 1 else "robot"
    loops = {"master": report.master.ticks if report.master else None, name: rows[worst].ticks}
    return ticks_text(loops, report.notes.host)


def _master_words(report: DemoReport) -> str:
    put_ms = number(report.master.frames_in_to_put_ms.p99 if report.master else None, 2)
    cpu = f"master: {report.cpu_percent['master']:.0f} % of a core"
    missing = {robot: row.due.missing for robot, row in report.robots.items() if row.due is not None}
    named = ", ".join(f"{robot} {count}" for robot, count in missing.items() if count)
    due = f"; commands missing when due: {named}" if named else ""
    return f"{cpu}, last frame in → put p99 {put_ms} ms; times in ms, p99{due}"


def _errors_deg(rig: Rig) -> dict[str, float]:
    truth, state = rig.observer.truth, rig.observer.state
    if truth is None or state is None:
        return {}
    errors = np.degrees(state.position_rad - truth.position_rad)
    return dict(zip(rig.observer.trace.joint_names, errors.tolist(), strict=True))
