"""The demo's tables in a terminal, at home in 80 columns."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from rich.console import Group, RenderableType
from rich.text import Text

from deploy.measure.accuracy import SIDES, Accuracy, JointAccuracy
from deploy.measure.motion import FollowedMotion
from deploy.measure.paper import ETA_PERCENT, TABLE_1
from deploy.report.tables import UNKNOWN, number, plain_table, within_limit

Stage = Mapping[str, Any]
"""A `Summary` as plain values: `count`, and `mean`, `p50`, `p99`, `max` in ms, None where count is 0."""


def latency_table(
    stages: Mapping[str, Stage],
    total: Stage | None = None,
    one_way: Mapping[str, Any] | None = None,
) -> RenderableType:
    """The latency budget: one row a stage in the order they happen, means that add up, and a total row.

    `total` is the measured whole, for its percentiles (those of stages do not add up). `one_way` may hold
    `bound` (ms) and `trusted`: how far the offset between the two clocks is known; and `p99`, `missing`,
    `corrected`: one way of all commands that were due, beside that of those that came.
    """
    table = plain_table("stage", "mean", "p50", "p99", "max", "count", title="latency budget, ms")
    for name, stage in stages.items():
        table.add_row(name, *stage_cells(stage))
    table.add_section()
    mean = sum(stage.get("mean") or 0.0 for stage in stages.values())
    count = min((stage.get("count", 0) for stage in stages.values()), default=0)
    sums = {"mean": mean, "count": count} if count else {}
    table.add_row("total", *stage_cells({**(total or {}), **sums}), style="bold")
    notes = [Text(MOVED_IS, "dim")] if "written→moved" in stages else []
    if one_way is None:
        return Group(table, *notes)
    bound = one_way.get("bound")
    if not one_way.get("trusted", bound is not None):
        known = Text("one-way times are not trusted: the clock offset is stale", "yellow")
    else:
        known = Text(f"one-way times are uncertain by ± {number(bound, 3)} ms", "dim")
    return Group(table, *notes, known, *_due_notes(one_way))


MOVED_IS = (
    "written→moved ends at the first change of any encoder: the loop is closed. A robot that moves already "
    "shows one at once, so this stage does not show how soon the robot answers; the motion lag does"
)


def _due_notes(one_way: Mapping[str, Any]) -> list[Text]:
    """The corrected figures beside the raw ones; nothing where they were not measured."""
    corrected, missing = one_way.get("corrected"), one_way.get("missing")
    if corrected is None or missing is None:
        return []
    p99, most = (number(corrected.get(key), 2) for key in ("p99", "max"))
    raw = f"one way p99 {number(one_way.get('p99'), 2)} ms of the commands that came"
    words = f"{raw}; {p99} ms, at most {most} ms, with the {missing} that were missing when due"
    return [Text(words, "yellow" if missing else "dim")]


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


def video_table(video: Mapping[str, Any]) -> RenderableType:
    """What the operator saw: rate and size, and how old it was when he acted; from a report's `video`."""
    if video["fault"]:
        return Text(f"no video: {video['fault']}", "yellow")
    ages = {"picture sent→received": "transit_ms", "picture taken→operator's act": "action_to_observation_ms"}
    table = plain_table("", "mean", "p50", "p99", "max", "count", title="video, ms")
    for name, key in ages.items():
        table.add_row(name, *stage_cells(video[key]))
    size = f"{video['fps']:.1f} Hz, {video['kb_s']:.0f} kB/s, {video['mean_kb']:.1f} kB each"
    reduced = (
        f"bitrate reduced {video['bitrate_reduced']}×; {video['not_acknowledged']} frames not acknowledged"
    )
    return Group(table, Text(f"{size}, {video['width']} pixels wide; {reduced}", "dim"))


def synergy_table(judged: Mapping[str, Mapping[str, float] | None]) -> RenderableType:
    """The joints of a coarser robot against truth, from a report's `synergies`."""
    table = plain_table(
        "joint", "mean abs °", "RMSE °", "largest °", title="as a robot's joints, by its synergies"
    )
    for name, row in judged.items():
        figures = [None if row is None else row[key] for key in ("mae_deg", "rmse_deg", "max_deg")]
        table.add_row(name, *(number(figure, 3) for figure in figures))
    return table


def ticks_text(loops: Mapping[str, Mapping[str, int] | None], host: Mapping[str, Any]) -> RenderableType:
    """Ticks that the loops missed, beside those of the reference loops in a report's `host`."""
    missed = ", ".join(f"{name} {_missed(ticks)}" for name, ticks in loops.items())
    if not host:
        return Text(f"ticks missed: {missed}; the host itself was not measured", "dim")
    first = "" if host["priority"] else " (without real-time priority: only steal excuses)"
    return Text(
        f"ticks missed: {missed}; by the host itself, of a reference loop{first}: {_missed(host['ticks'])}, "
        f"still for {host['longest_ms']:.0f} ms at most, {host['steal_percent']:.1f} % of its time stolen",
        "dim",
    )


def holds_text(holds: Iterable[Mapping[str, Any]]) -> RenderableType:
    """Each time a robot held by itself and was engaged again, from a report's `holds`."""
    lines = [
        f"{row['robot']} held at {row['at_s']:.1f} s for "
        f"{number(row['lasted_s'], 1)} s: {row['reason']} ({row['host']})"
        for row in holds
    ]
    if not lines:
        return Text("the robot never held by itself", "dim")
    return Text("\n".join(lines), "yellow")


def _missed(ticks: Mapping[str, int] | None) -> str:
    ticks = ticks or {}
    return f"{ticks.get('missed', UNKNOWN)} of {ticks.get('expected', UNKNOWN)}"


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


def stage_cells(stage: Stage) -> list[str]:
    """Mean, percentiles, maximum and count of one stage."""
    count = stage.get("count")
    cells = [number(stage.get(key), 2) for key in ("mean", "p50", "p99", "max")]
    return [*cells, UNKNOWN if count is None else f"{count:.0f}"]
