"""What a person sees of a soak: where it is, how the robot and the processes do; in the end the verdicts."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

from rich.console import Group, RenderableType
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from deploy.experiments.soak.files.events import AnyEvent
from deploy.experiments.soak.files.options import in_words
from deploy.report.tables import GUARD_STYLE, UNKNOWN, plain_table

if TYPE_CHECKING:
    from deploy.experiments.soak.files.log import SoakLog
    from deploy.experiments.soak.progress import SoakProgress
    from deploy.experiments.soak.stage import Stage

HIDDEN = ("begin", "started", "guard", "lease", "joints", "undone", "still")
"""Events that the live view does not show."""


def draw(
    progress: SoakProgress, stage: Stage, log: SoakLog, row: Mapping[str, float | str]
) -> RenderableType:
    """The live view."""
    guard = str(row.get("guard", "")) or "silent"
    head = Text.assemble(
        "robot ", (guard, GUARD_STYLE.get(guard, "")), "   one way ", _figure(row, "one_way_p50_ms", " ms"),
        "   round trip ", _figure(row, "round_trip_ms", " ms"),
        f"   lost {_figure(row, 'lost')}   missed ticks {_figure(row, 'master_missed')}"
        f" + {_figure(row, 'slave_missed')}",
    )  # fmt: skip
    table = plain_table("process", "life", "RSS MB", "descriptors", "threads")
    for name in [*stage.names, "soak"]:
        figures = [_figure(row, f"{name}_{what}") for what in ("life", "rss_mb", "fds", "threads")]
        table.add_row(name, *figures)
    newest = [line(event) for event in log.newest if event.what.kind not in HIDDEN]
    return Group(_bar(progress, log.now_s), head, table, *newest[-4:])


def _bar(progress: SoakProgress, now_s: float) -> RenderableType:
    if progress.began_s is None:
        return Text(f"{in_words(now_s)}: {progress.busy}", "bold")
    gone_s = now_s - progress.began_s
    left = in_words(progress.duration_s - gone_s)
    words = progress.busy or "following"
    if not progress.busy and progress.next < len(progress.planned):
        coming = progress.planned[progress.next]
        words = f"{coming.fault} in {in_words(coming.at_s - gone_s)}"
    line = Table.grid(padding=(0, 2))
    faults = f"fault {progress.next} of {len(progress.planned)}"
    line.add_row(
        ProgressBar(progress.duration_s, gone_s, width=24), f"{left} left", faults, Text(words, "bold")
    )
    return line


def line(event: AnyEvent) -> Text:
    """One event, as a line."""
    written = event.what.written().items()
    what = ", ".join(f"{key} {value}" for key, value in written if value not in (None, "", False, True))
    return Text(f"{event.at_s:8.1f} s  {event.what.kind}  {what}", "dim", overflow="ellipsis", no_wrap=True)


def _figure(row: Mapping[str, float | str], name: str, unit: str = "") -> str:
    value = row.get(name)
    if not isinstance(value, float | int) or math.isnan(value):
        return UNKNOWN
    return f"{value:.0f}{unit}" if float(value).is_integer() else f"{value:.2f}{unit}"
