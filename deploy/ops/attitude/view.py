"""What a person sees of an attitude instrument."""

from __future__ import annotations

import math
from collections.abc import Mapping

from rich import box
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from deploy.ops.attitude.reading import ANGLES, AngleRange, AttitudeLog

_SILENT_S = 1.0
_NONE = "–"


def screen(session: AttitudeLog, now_s: float, source: str, counters: Mapping[str, int]) -> RenderableType:
    """Each angle now and the span it went through, as in the paper's Fig. 5; what came and was refused."""
    newest = session.newest
    if newest is None:
        return Text(f"{source}: nothing yet. Is the instrument on, and the baud rate its own?", "yellow")
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    table.add_column("")
    for head in ("now °", "from °", "to °"):
        table.add_column(head, justify="right", no_wrap=True)
    for name in ANGLES:
        if name in newest.angles:
            angle = newest.angles[name]
            now = _NONE if angle is None else f"{math.degrees(angle):.1f}"
            table.add_row(name.replace("_", " "), Text(now, "bold"), *_ends(session.spans[name]))
    age_s = now_s - newest.at_s
    life = Text(f"{source}: {session.readings} readings", "dim")
    if age_s > _SILENT_S:
        life = Text(f"{source}: silent for {age_s:.0f} s", "bold red")
    counted = "   ".join(f"{name.replace('_', ' ')} {count}" for name, count in counters.items())
    return Group(table, life, Text(counted, "dim"))


def _ends(span: AngleRange) -> tuple[str, str]:
    ends = span.ends
    if ends is None:
        return _NONE, _NONE
    low, high = (math.degrees(end) for end in ends)
    return f"{low:.1f}", f"{high:.1f}"
