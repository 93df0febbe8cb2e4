"""What a person at the suit sees: what to do now, and every node's progress."""

from __future__ import annotations

from collections.abc import Sequence

from rich import box
from rich.columns import Columns
from rich.console import Group, RenderableType
from rich.panel import Panel
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from deploy.calibrate.live.guide import View
from deploy.calibrate.live.window import NodeProgress

_FEW = 12
"""More nodes than this are shown in two columns."""


def screen(view: View, nodes: Sequence[str], seconds: float) -> RenderableType:
    """The whole picture."""
    head = Text.assemble(
        (f"step {view.number} of {view.steps}: {view.title}", "bold"), (f"   {seconds:.0f} s", "dim")
    )
    parts: list[RenderableType] = [Panel(Group(head, Text(view.todo)), box=box.ROUNDED)]
    if view.nodes:
        rows = list(zip(nodes, view.nodes, strict=True))
        half = len(rows) if len(rows) <= _FEW else (len(rows) + 1) // 2
        tables = [_table(rows[at : at + half]) for at in range(0, len(rows), half)]
        parts.append(Columns(tables, padding=(0, 3)))
        parts.append(Text(f"{100.0 * view.share:.0f} % of this step; Enter: go on with what there is", "dim"))
    return Group(*parts)


def line(view: View, nodes: Sequence[str], seconds: float) -> str:
    """The same in one line, for a log: the step and the node that wants most."""
    if not view.nodes:
        return f"{seconds:6.1f} s  {view.title}"
    last = min(range(len(view.nodes)), key=lambda i: view.nodes[i].share)
    wanting = f"{nodes[last]}: {view.nodes[last].text}"
    return (
        f"{seconds:6.1f} s  {view.number}/{view.steps} {view.title}, {100.0 * view.share:3.0f} %; {wanting}"
    )


def _table(rows: Sequence[tuple[str, NodeProgress]]) -> Table:
    table = Table(box=None, show_header=False, padding=(0, 1))
    for name, node in rows:
        colour = "green" if node.share >= 1.0 else "yellow" if node.share > 0.0 else "red"
        bar = ProgressBar(total=1.0, completed=node.share, width=10, complete_style=colour)
        table.add_row(Text(name, colour), bar, Text(node.text, "dim" if node.share >= 1.0 else ""))
    return table
