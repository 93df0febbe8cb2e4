"""Tables for people: rich renderables from plain data, all of them at home in 80 columns."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

from rich import box
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from deploy.measure.accuracy import SIDES, Accuracy, JointAccuracy
from deploy.measure.motion import Motion
from deploy.measure.paper import ETA_PERCENT, TABLE_1

Stage = Mapping[str, Any]
"""A `Summary` as plain values: `count`, and `mean`, `p50`, `p99`, `max` in ms, None where count is 0."""
UNKNOWN = "–"


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
    table = _table("latency budget, ms", "stage", "mean", "p50", "p99", "max", "count")
    for name, stage in stages.items():
        table.add_row(name, *_stage_cells(stage))
    table.add_section()
    mean = sum(stage.get("mean") or 0.0 for stage in stages.values())
    count = min((stage.get("count", 0) for stage in stages.values()), default=0)
    sums = {"mean": mean, "count": count} if count else {}
    table.add_row("total", *_stage_cells({**(total or {}), **sums}), style="bold")
    notes = [Text(MOVED_IS, "dim")] if "written→moved" in stages else []
    if one_way is None:
        return Group(table, *notes)
    bound = one_way.get("bound")
    if not one_way.get("trusted", bound is not None):
        known = Text("one-way figures are not trusted: the clocks' offset is stale", "yellow")
    else:
        known = Text(f"one-way figures are known to ± {_number(bound, 3)} ms", "dim")
    return Group(table, *notes, known, *_due_notes(one_way))


MOVED_IS = (
    "written→moved ends at the first change of any encoder: the loop is closed. A robot that moves already "
    "shows one at once, so it does not tell how soon the robot answers; the motion lag does"
)


def _due_notes(one_way: Mapping[str, Any]) -> list[Text]:
    """The corrected figures beside the raw ones; nothing where they were not measured."""
    corrected, missing = one_way.get("corrected"), one_way.get("missing")
    if corrected is None or missing is None:
        return []
    p99, most = (_number(corrected.get(key), 2) for key in ("p99", "max"))
    raw = f"one way p99 {_number(one_way.get('p99'), 2)} ms of the commands that came"
    words = f"{raw}; {p99} ms, at most {most} ms, with the {missing} that were not there when they were due"
    return [Text(words, "yellow" if missing else "dim")]


def accuracy_table(judged: Accuracy) -> RenderableType:
    """Solved against truth: the paper's Table 1 beside ours, η beside what it hides, then every joint.

    A robot that has none of Table 1's joints gets the last part alone.
    """
    if not judged.fast:
        return _joints_table(judged)
    table = _table("solved against truth, fast periods", "joint")
    for head in ("°/step", "left °", "right °", "paper °", "ratio", "paper"):
        table.add_column(head, justify="right", no_wrap=True)
    for joint, paper in TABLE_1.items():
        rows = [judged.fast.get(f"{side}_{joint}") for side in SIDES]
        errors = [_marked(None if row is None else row.error_deg, paper.error_deg, digits=3) for row in rows]
        worse = judged.worse(joint)
        table.add_row(
            joint.replace("_", " "),
            _number(None if worse is None else worse.change_deg, 2),
            *errors,
            _number(paper.error_deg, 3),
            _marked(None if worse is None else worse.ratio, paper.ratio, digits=3),
            _number(paper.ratio, 3),
        )
    eta = Text.assemble(
        "η ", _marked(judged.eta_percent, ETA_PERCENT, digits=2), f" % (paper {ETA_PERCENT} %)"
        f"; beside it, mean absolute error {_number(judged.fast_mae_deg, 3)}°"
        f", RMSE {_number(judged.fast_rmse_deg, 3)}°",
    )  # fmt: skip
    return Group(table, eta, _joints_table(judged))


def motion_table(judged: Motion | None) -> RenderableType:
    """Moved against truth: each joint that moved, the worst first, then over all."""
    if judged is None:
        return Text(
            "moved against truth: not enough data (was the robot in track, did it move, "
            "were 95 % of each encoder's readings valid?)",
            "yellow",
        )
    table = _table("moved against truth", "joint", "RMSE °", "aligned °", "roughness")
    for name, joint in sorted(judged.joints.items(), key=lambda item: -item[1].rmse_deg):
        table.add_row(
            name,
            _number(joint.rmse_deg, 2),
            _number(joint.aligned_rmse_deg, 2),
            _number(joint.roughness, 2),
        )
    table.add_section()
    figures = (judged.rmse_deg, judged.aligned_rmse_deg, judged.roughness)
    table.add_row("all moving joints", *(_number(f, 2) for f in figures), style="bold")
    if judged.lag_ms is None:
        return Group(table, Text("motion lag: no shift within the search fits", "yellow"))
    return Group(table, Text(f"motion lag {judged.lag_ms:.0f} ms", "bold"))


def strategies_table(as_run: Motion, replayed: Mapping[str, Motion]) -> RenderableType:
    """The run beside what each strategy makes of the same commands on the virtual robot."""
    table = _table("same commands, each strategy", "", "RMSE °", "lag ms", "aligned °", "roughness")
    for name, judged in {"this run": as_run, **{f"{s}, replayed": m for s, m in replayed.items()}}.items():
        table.add_row(
            name,
            _number(judged.rmse_deg, 2),
            _number(judged.lag_ms, 0),
            _number(judged.aligned_rmse_deg, 2),
            _number(judged.roughness, 2),
        )
    return table


def video_table(video: Mapping[str, Any]) -> RenderableType:
    """What the operator saw: rate and size, and how old it was when he acted; from a report's `video`."""
    if video["fault"]:
        return Text(f"no video: {video['fault']}", "yellow")
    ages = {"picture sent→received": "transit_ms", "picture taken→operator's act": "action_to_observation_ms"}
    table = _table("video, ms", "", "mean", "p50", "p99", "max", "count")
    for name, key in ages.items():
        table.add_row(name, *_stage_cells(video[key]))
    size = f"{video['fps']:.1f} Hz, {video['kb_s']:.0f} kB/s, {video['mean_kb']:.1f} kB each"
    seen = f"{video['width']} pixels wide; gave way {video['gave_way']} times, {video['unseen']} unseen"
    return Group(table, Text(f"{size}, {seen}", "dim"))


def synergy_table(judged: Mapping[str, Mapping[str, float] | None]) -> RenderableType:
    """The joints of a coarser robot, solved against truth: from a report's `synergies`."""
    table = _table("as a robot's joints, by its synergies", "joint", "mean abs °", "RMSE °", "largest °")
    for name, row in judged.items():
        figures = [None if row is None else row[key] for key in ("mae_deg", "rmse_deg", "max_deg")]
        table.add_row(name, *(_number(figure, 3) for figure in figures))
    return table


def ticks_text(ours: Mapping[str, Mapping[str, int] | None], host: Mapping[str, Any]) -> RenderableType:
    """Ticks that our loops missed beside those of a loop that does nothing else, from a report's `host`."""
    missed = ", ".join(f"{name} {_missed(ticks)}" for name, ticks in ours.items())
    if not host:
        return Text(f"ticks missed: {missed}; the host itself was not measured", "dim")
    first = "" if host["priority"] else " (without real-time priority: only steal excuses)"
    return Text(
        f"ticks missed: {missed}; by the host itself, of a bare loop{first}: {_missed(host['ticks'])}, "
        f"still for {host['longest_ms']:.0f} ms at most, {host['steal_percent']:.1f} % of its time stolen",
        "dim",
    )


def holds_text(holds: Iterable[Mapping[str, Any]]) -> RenderableType:
    """Each time a robot held by itself and was engaged again, from a report's `holds`."""
    lines = [
        f"{row['robot']} held at {row['at_s']:.1f} s for "
        f"{_number(row['lasted_s'], 1)} s: {row['reason']} ({row['host']})"
        for row in holds
    ]
    if not lines:
        return Text("the robot never held by itself", "dim")
    return Text("\n".join(lines), "yellow")


def _missed(ticks: Mapping[str, int] | None) -> str:
    ticks = ticks or {}
    return f"{ticks.get('missed', UNKNOWN)} of {ticks.get('expected', UNKNOWN)}"


_BENCH_ROWS = (
    ("loop lateness, idle, µs", ("loop", "idle", "late_us")),
    ("the same with the missed ticks, µs", ("loop", "idle", "corrected_us")),
    ("loop lateness, busy core, µs", ("loop", "busy", "late_us")),
    ("that with the missed ticks, µs", ("loop", "busy", "corrected_us")),
    ("receive + decode, 36 nodes, CPU µs", ("capture", "nodes_36", "cpu_us")),
    ("receive + decode, 8 classic, CPU µs", ("capture", "nodes_8_classic", "cpu_us")),
    ("answers in, 36 nodes, µs", ("capture", "nodes_36", "answers_us")),
    ("decode, 8 nodes, µs", ("pipeline", "nodes_8", "decode_us")),
    ("decode, 36 nodes, µs", ("pipeline", "nodes_36", "decode_us")),
    ("filter + fuse, 8 nodes, µs", ("pipeline", "nodes_8", "fuse_us")),
    ("filter + fuse, 36 nodes, µs", ("pipeline", "nodes_36", "fuse_us")),
    ("the same with mahony, µs", ("pipeline", "nodes_36_mahony", "fuse_us")),
    ("the same with ekf, µs", ("pipeline", "nodes_36_ekf", "fuse_us")),
    ("solve 25 joints, µs", ("pipeline", "solve_us")),
    ("judge whether 36 nodes lie, µs a tick", ("pipeline", "believe_us")),
    ("solve beyond the robot's limits, µs", ("pipeline", "solve_beyond_us")),
    ("encode + decode, µs", ("pipeline", "codec_us")),
    ("one way, tandem, µs", ("link", "one_way_us", "tandem")),
    ("one way, bare Zenoh, µs", ("link", "one_way_us", "zenoh")),
    ("one way, bare UDP, µs", ("link", "one_way_us", "udp")),
    *(
        (f"one way over {name}, µs", ("transports", "one_way_us", name))
        for name in ("bare zenoh", "tcp", "udp", "tls", "quic", "quic-datagram", "ws", "unixsock-stream")
    ),
    ("MuJoCo step, µs", ("robot", "step_us")),
)


def bench_table(report: Mapping[str, Any]) -> RenderableType:
    """The figures of `tandem bench`, then percent of a core."""
    table = _table("bench", "", "min", "median", "p99", "max")
    for name, path in _BENCH_ROWS:
        figures = _within(report, path)
        table.add_row(name, *(_number(figures.get(key), 1) for key in ("min", "median", "p99", "max")))
    shares = (f"{name.replace('_', ' ')} {_number(v, 1)}" for name, v in report["core_percent"].items())
    alone = _within(report, ("loop", "idle"))
    missed = Text(
        f"ticks missed by a loop that does nothing else: {alone.get('missed', UNKNOWN)} "
        f"of {alone.get('late_us', {}).get('count', UNKNOWN)} run; "
        "a pipeline on this machine can do no better"
    )
    return Group(table, Text("percent of one core: " + ", ".join(shares), "bold"), missed)


@dataclass(frozen=True, slots=True)
class Live:
    """What the live view shows of a running pair."""

    elapsed_s: float
    guard: str
    reason: str
    rates_hz: Mapping[str, float] = field(default_factory=dict)
    """Such as capture, commands, states."""
    stages: Mapping[str, Stage] = field(default_factory=dict)
    joint_error_deg: Mapping[str, float] = field(default_factory=dict)
    """Encoder minus truth now, by joint; the worst few are shown."""
    drops: Mapping[str, int] = field(default_factory=dict)
    """What was lost or refused, by reason; zeros are not shown."""


GUARD_STYLE = {"track": "bold green", "align": "bold cyan", "hold": "yellow", "estop": "bold red"}


def live_view(live: Live, worst: int = 5) -> RenderableType:
    """One screen, redrawn a few times a second."""
    head = Text.assemble(
        f"{live.elapsed_s:6.1f} s   robot ", (live.guard or UNKNOWN, GUARD_STYLE.get(live.guard, "")),
        f"   {live.reason}", overflow="ellipsis", no_wrap=True,
    )  # fmt: skip
    rates = "   ".join(f"{name} {rate:.1f} Hz" for name, rate in live.rates_hz.items()) or UNKNOWN
    errors = sorted(live.joint_error_deg.items(), key=lambda item: -abs(item[1]))[:worst]
    dropped = "   ".join(f"{name} {count}" for name, count in live.drops.items() if count)
    joints = Text("   ".join(f"{name} {error:+.1f}°" for name, error in errors) or UNKNOWN)
    lines = Table.grid(padding=(0, 2))
    lines.add_row(Text("rates", "dim"), Text(rates))
    lines.add_row(Text("worst joints", "dim"), joints)
    lines.add_row(Text("dropped", "dim"), Text(dropped, "yellow") if dropped else Text("nothing", "green"))
    table = _table("", "stage, ms", "mean", "p50", "p99", "max", "count")
    for name, stage in live.stages.items():
        table.add_row(name, *_stage_cells(stage))
    return Group(head, lines, table)


def _joints_table(judged: Accuracy) -> RenderableType:
    heads = ("mean abs °", "RMSE °", "bias °", "largest °", "estimated %")
    table = _table("solved against truth, whole run", "joint", *heads)
    for name, joint in judged.joints.items():
        cells = [UNKNOWN] * 4 if joint is None else _joint_cells(joint)
        share = judged.estimated.get(name)
        table.add_row(name, *cells, _number(None if share is None else 100.0 * share, 1))
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
    return [_number(x, 3) for x in (joint.mae_deg, joint.rmse_deg, joint.bias_deg, joint.max_deg)]


def _within(report: Mapping[str, Any], path: Iterable[str]) -> Any:
    found: Any = report
    for key in path:
        found = found.get(key, {})
    return found


def plain_table(first: str, *others: str) -> Table:
    """A table of ours without a title: the first column of words, the others right-aligned."""
    return _table("", first, *others)


def _table(title: str, first: str, *others: str) -> Table:
    table = Table(title=title or None, title_justify="left", box=box.SIMPLE_HEAD, pad_edge=False)
    table.add_column(first, overflow="fold")
    for head in others:
        table.add_column(head, justify="right", no_wrap=True)
    return table


def _stage_cells(stage: Stage) -> list[str]:
    count = stage.get("count")
    cells = [_number(stage.get(key), 2) for key in ("mean", "p50", "p99", "max")]
    return [*cells, UNKNOWN if count is None else f"{count:.0f}"]


def _marked(value: float | None, limit: float, digits: int) -> Text:
    if value is None:
        return Text(UNKNOWN)
    return Text(_number(value, digits), "green" if value <= limit else "bold red")


def _number(value: float | None, digits: int) -> str:
    return UNKNOWN if value is None else f"{value:.{digits}f}"
