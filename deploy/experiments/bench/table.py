"""The bench's table in a terminal."""

from __future__ import annotations

from collections.abc import Mapping

from rich.console import Group, RenderableType
from rich.text import Text

from deploy.report.tables import UNKNOWN, number, plain_table

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
    ("orientations of 8 nodes, µs", ("pipeline", "nodes_8", "orientation_us")),
    ("orientations of 36 nodes, µs", ("pipeline", "nodes_36", "orientation_us")),
    ("the same with mahony, µs", ("pipeline", "nodes_36_mahony", "orientation_us")),
    ("the same with ekf, µs", ("pipeline", "nodes_36_ekf", "orientation_us")),
    ("25 joint angles, µs", ("pipeline", "joint_angles_us")),
    ("plausibility of 36 nodes, µs a tick", ("pipeline", "plausibility_us")),
    ("joint angles beyond the robot's limits, µs", ("pipeline", "joint_angles_beyond_us")),
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


def bench_table(report: Mapping[str, object], core_percent: Mapping[str, float | None]) -> RenderableType:
    """The measurements of `tandem bench`, then percent of a core."""
    table = plain_table("", "min", "median", "p99", "max", title="bench")
    for name, path in _BENCH_ROWS:
        figures = figures_at(report, *path)
        table.add_row(name, *(number(figures.get(key), 1) for key in ("min", "median", "p99", "max")))
    shares = (f"{name.replace('_', ' ')} {number(v, 1)}" for name, v in core_percent.items())
    idle = figures_at(report, "loop", "idle")
    missed = Text(
        f"ticks missed by a loop that does nothing else: {idle.get('missed', UNKNOWN)} "
        f"of {figures_at(report, 'loop', 'idle', 'late_us').get('count', UNKNOWN)} run; "
        "a pipeline on this machine can do no better"
    )
    return Group(table, Text("percent of one core: " + ", ".join(shares), "bold"), missed)


def figures_at(report: Mapping[str, object], *path: str) -> Mapping[str, float]:
    """The part of a report at these keys; {} where a bench did not give it."""
    found: object = report
    for key in path:
        found = found.get(key) if isinstance(found, Mapping) else None
    return found if isinstance(found, Mapping) else {}
