"""What `tandem network` shows people."""

from __future__ import annotations

from collections.abc import Iterable

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from deploy.ops.network.figures import Measured, WayMeasured
from deploy.report.tables import UNKNOWN, plain_table
from deploy.sim.network.profile import Profile, Way


def profiles_table(profiles: Iterable[Profile]) -> Table:
    """One row a direction where the two differ, else one for both."""
    table = plain_table("profile", "to", "delay", "jitter", "loss %", "burst", "Mbit/s", "queue")
    table.columns[0].no_wrap = True
    table.caption = "delay, jitter and queue in ms; burst in packets, – for independent losses"
    for profile in profiles:
        ways = profile.ways
        rows = {"robot": ways.to_robot, "operator": ways.to_operator}
        if ways.to_robot == ways.to_operator:
            rows = {"both": ways.to_robot}
        for number, (arrow, way) in enumerate(rows.items()):
            table.add_row("" if number else profile.name, arrow, *_cells(way))
    return table


def _cells(way: Way) -> list[str]:
    figures = (way.delay_ms, way.jitter_ms, way.loss_percent, way.burst_packets, way.rate_mbit)
    queue = way.queue_ms if way.rate_mbit else None
    return [UNKNOWN if figure is None else f"{figure:g}" for figure in (*figures, queue)]


def measured_table(measured: Iterable[Measured]) -> RenderableType:
    """Measured beside the profile: a row a direction."""
    table = plain_table("way", "delay", "mean", "p50", "p99", "jit", "lost", "of", "re/du", "Mbit")
    table.columns[0].no_wrap = True
    names = []
    for each in measured:
        names.append(each.profile)
        for end, way in (("→", each.to_robot), ("←", each.to_operator)):
            table.add_row(f"{len(names)} {end}", *_measured_cells(way), end_section=end == "←")
    key = ", ".join(f"{number} {name}" for number, name in enumerate(names, 1))
    return Group(
        table, f"{key}; → to the robot. ms, and % lost, reordered/duplicated; ±: by chance, three sigma"
    )


def _measured_cells(way: WayMeasured) -> list[str | Text]:
    loss = f"{way.expected_loss_percent:.1f}±{way.loss_bound_percent:.1f}"
    rate = UNKNOWN if way.rate_mbit is None else f"{way.rate_mbit:.1f}"
    return [
        f"{way.expected_ms:.1f}±{way.delay_bound_ms:.1f}",
        _judged(f"{way.mean_ms:.2f}", way.delay_kept),
        f"{way.p50_ms:.1f}",
        f"{way.p99_ms:.1f}",
        f"{way.jitter_ms:.1f}",
        _judged(f"{way.loss_percent:.2f}", way.loss_kept),
        loss,
        f"{way.reordered_percent:.1f}/{way.duplicate_percent:.1f}",
        _judged(rate, way.rate_kept),
    ]


def _judged(text: str, kept: bool) -> Text:
    return Text(text, style="" if kept else "red")
