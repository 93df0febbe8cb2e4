"""The demo's tables in a terminal, at home in 80 columns."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from rich.console import Group, RenderableType
from rich.text import Text

from common.metrics.parts import Summary, Ticks
from common.metrics.slave import CameraMetrics, SlaveMetrics
from deploy.harness.host import HostMetrics
from deploy.harness.operator import HoldRecord
from deploy.measure.accuracy import SIDES, Accuracy, JointAccuracy
from deploy.measure.motion import FollowedMotion
from deploy.measure.paper import ETA_PERCENT, TABLE_1
from deploy.report.tables import UNKNOWN, number, plain_table, within_limit


def latency_table(slave: SlaveMetrics | None) -> RenderableType:
    """The latency budget: one row a stage in the order they happen, means that add up, and a total row.

    The total's percentiles are of the measured whole: those of stages do not add up.
    """
    table = plain_table("stage", "mean", "p50", "p99", "max", "count", title="latency budget, ms")
    if slave is None:
        return table
    for name, stage in slave.stages_ms.items():
        table.add_row(name, *stage_cells(stage))
    table.add_section()
    stages, total = slave.stages_ms.values(), slave.end_to_end_ms
    if count := min((stage.count for stage in stages), default=0):
        total = replace(total, mean=sum(stage.mean or 0.0 for stage in stages), count=count)
    table.add_row("total", *stage_cells(total), style="bold")
    notes = [Text(MOVED_IS, "dim")] if "written→moved" in slave.stages_ms else []
    if slave.offset.trusted:
        words = f"one-way times are uncertain by ± {slave.offset.bound_ms:.3f} ms"
        known = Text(f"{words}: {slave.offset.words}" if slave.offset.words else words, "dim")
    else:
        known = Text("one-way times are not trusted: the clock offset is stale", "yellow")
    return Group(table, *notes, known, _due_note(slave))


MOVED_IS = (
    "written→moved ends at the first change of any encoder: the loop is closed. A robot that moves already "
    "shows one at once, so this stage does not show how soon the robot answers; the motion lag does"
)


def _due_note(slave: SlaveMetrics) -> Text:
    """The corrected one-way times beside the raw ones."""
    raw, corrected, missing = slave.one_way_ms, slave.one_way_corrected_ms, slave.due.missing
    words = (
        f"one way p99 {number(raw.p99, 2)} ms of the commands that came; {number(corrected.p99, 2)} ms, "
        f"at most {number(corrected.max, 2)} ms, with the {missing} that were missing when due"
    )
    return Text(words, "yellow" if missing else "dim")


def accuracy_table(judged: Accuracy) -> RenderableType:
    """Joint angles against truth: beside the paper's Table 1, η beside what it hides, then every joint.

    A robot that has none of Table 1's joints gets the last part alone.
    """
    if not judged.fast:
        return _joints_table(judged)
    table = plain_table("joint", title="joint angles against truth, fast periods")
    for head in ("°/step", "left °", "right °", "paper °", "ratio", "paper"):
        table.add_column(head, justify="right", no_wrap=True)
    for joint, paper in TABLE_1.items():
        rows = [judged.fast.get(f"{side}_{joint}") for side in SIDES]
        errors = [
            within_limit(None if row is None else row.error_deg, paper.error_deg, digits=3) for row in rows
        ]
        worse = judged.worse(joint)
        table.add_row(
            joint.replace("_", " "),
            number(None if worse is None else worse.change_deg, 2),
            *errors,
            number(paper.error_deg, 3),
            within_limit(None if worse is None else worse.ratio, paper.ratio, digits=3),
            number(paper.ratio, 3),
        )
    eta = Text.assemble(
        "η ", within_limit(judged.eta_percent, ETA_PERCENT, digits=2), f" % (paper {ETA_PERCENT} %)"
        f"; beside it, mean absolute error {number(judged.fast_mae_deg, 3)}°"
        f", RMSE {number(judged.fast_rmse_deg, 3)}°",
    )  # fmt: skip
    return Group(table, eta, _joints_table(judged))


def motion_table(judged: FollowedMotion | None) -> RenderableType:
    """Motion against truth: each joint that moved, the worst first, then all of them."""
    if judged is None:
        return Text(
            "motion against truth: not enough data (was the robot in track, did it move, "
            "were 95 % of each encoder's readings valid?)",
            "yellow",
        )
    table = plain_table("joint", "RMSE °", "aligned °", "roughness", title="motion against truth")
    for name, joint in sorted(judged.joints.items(), key=lambda item: -item[1].rmse_deg):
        table.add_row(
            name,
            number(joint.rmse_deg, 2),
            number(joint.aligned_rmse_deg, 2),
            number(joint.roughness, 2),
        )
    table.add_section()
    figures = (judged.rmse_deg, judged.aligned_rmse_deg, judged.roughness)
    table.add_row("all moving joints", *(number(f, 2) for f in figures), style="bold")
    if judged.lag_ms is None:
        return Group(table, Text("motion lag: no shift within the search fits", "yellow"))
    return Group(table, Text(f"motion lag {judged.lag_ms:.0f} ms", "bold"))


def strategies_table(as_run: FollowedMotion, replayed: Mapping[str, FollowedMotion]) -> RenderableType:
    """The run beside what each strategy makes of the same commands on the virtual robot."""
    table = plain_table(
        "", "RMSE °", "lag ms", "aligned °", "roughness", title="same commands, each strategy"
    )
    for name, judged in {"this run": as_run, **{f"{s}, replayed": m for s, m in replayed.items()}}.items():
        table.add_row(
            name,
            number(judged.rmse_deg, 2),
            number(judged.lag_ms, 0),
            number(judged.aligned_rmse_deg, 2),
            number(judged.roughness, 2),
        )
    return table


def video_table(video: CameraMetrics) -> RenderableType:
    """What the operator saw: rate and size, and how old it was when he acted."""
    if video.fault:
        return Text(f"no video: {video.fault}", "yellow")
    table = plain_table("", "mean", "p50", "p99", "max", "count", title="video, ms")
    table.add_row("picture sent→received", *stage_cells(video.transit_ms))
    table.add_row("picture taken→operator's act", *stage_cells(video.action_to_observation_ms))
    size = (
        f"{video.fps:.1f} Hz, {video.kb_s:.0f} kB/s, {video.mean_kb:.1f} kB each, {video.width} pixels wide"
    )
    reduced = f"bitrate reduced {video.bitrate_reduced}×; {video.not_acknowledged} frames not acknowledged"
    return Group(table, Text(f"{size}; {reduced}", "dim"))


def synergy_table(judged: Mapping[str, JointAccuracy | None]) -> RenderableType:
    """The joints of a coarser robot against truth."""
    title = "as a robot's joints, by its synergies"
    table = plain_table("joint", "mean abs °", "RMSE °", "largest °", title=title)
    for name, row in judged.items():
        errors = (None, None, None) if row is None else (row.mae_deg, row.rmse_deg, row.max_deg)
        table.add_row(name, *(number(error, 3) for error in errors))
    return table


def ticks_text(loops: Mapping[str, Ticks | None], host: HostMetrics | None) -> RenderableType:
    """Ticks that the loops missed, beside those of the reference loops."""
    missed = ", ".join(f"{name} {_missed(ticks)}" for name, ticks in loops.items())
    if host is None:
        return Text(f"ticks missed: {missed}; the host itself was not measured", "dim")
    first = "" if host.priority else " (without real-time priority: only steal excuses)"
    return Text(
        f"ticks missed: {missed}; by the host itself, of a reference loop{first}: {_missed(host.ticks)}, "
        f"still for {host.longest_ms:.0f} ms at most, {host.steal_percent:.1f} % of its time stolen",
        "dim",
    )


def holds_text(holds: Sequence[HoldRecord]) -> RenderableType:
    """Each time a robot held by itself and was engaged again."""
    lines = [
        f"{hold.robot} held at {hold.at_s:.1f} s for {number(hold.lasted_s, 1)} s: "
        f"{hold.reason} ({hold.host})"
        for hold in holds
    ]
    return Text("\n".join(lines), "yellow") if lines else Text("the robot never held by itself", "dim")


def _missed(ticks: Ticks | None) -> str:
    return f"{UNKNOWN} of {UNKNOWN}" if ticks is None else f"{ticks.missed} of {ticks.expected}"


def _joints_table(judged: Accuracy) -> RenderableType:
    heads = ("mean abs °", "RMSE °", "bias °", "largest °", "estimated %")
    table = plain_table("joint", *heads, title="joint angles against truth, whole run")
    for name, joint in judged.joints.items():
        cells = [UNKNOWN] * 4 if joint is None else _joint_cells(joint)
        share = judged.estimated.get(name)
        table.add_row(name, *cells, number(None if share is None else 100.0 * share, 1))
    if judged.overall is not None:
        table.add_section()
        table.add_row("all joints", *_joint_cells(judged.overall), style="bold")
    if not judged.withheld:
        return table
    words = (
        f"not judged, estimated for less than 95 %: {', '.join(judged.withheld)}; nor any figure over them"
    )
    return Group(table, Text(words, "yellow"))


def _joint_cells(joint: JointAccuracy) -> list[str]:
    return [number(x, 3) for x in (joint.mae_deg, joint.rmse_deg, joint.bias_deg, joint.max_deg)]


def stage_cells(stage: Summary) -> list[str]:
    """Mean, percentiles, maximum and count of one stage."""
    return [*(number(value, 2) for value in (stage.mean, stage.p50, stage.p99, stage.max)), str(stage.count)]
