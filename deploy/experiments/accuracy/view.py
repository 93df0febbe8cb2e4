"""The scores of `tandem accuracy FILE...` as a table."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rich import box
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from deploy.experiments.accuracy.broad import LEAST_ESTIMATED

_PARTS = ("total_deg", "heading_deg", "inclination_deg")


def accuracy_of_files(tree: Mapping[str, Any]) -> RenderableType:
    """A row a recording and filter, the mean below, and what is worth knowing of single files."""
    table = Table(title="RMSE while moving, °", title_justify="left", box=box.SIMPLE_HEAD, pad_edge=False)
    table.add_column("recording", overflow="fold")
    for head in ("filter", "total", "heading", "inclin.", "µs a sample"):
        table.add_column(head, justify="left" if head == "filter" else "right", no_wrap=True)
    notes = []
    for path, figures in tree["files"].items():
        name = Path(path).stem
        for filter_, found in figures["filters"].items():
            table.add_row(name, filter_, *_cells(found), f"{found['us_per_sample']['median']:.1f}")
            name = ""
        notes += [Text(f"{Path(path).stem}: {note}", "yellow") for note in _notes(figures)]
    if len(tree["files"]) > 1 and tree["mean"]:
        table.add_section()
        for filter_, found in tree["mean"].items():
            table.add_row("mean", filter_, *_cells(found), "", style="bold")
    return Group(table, *notes)


def _cells(found: Mapping[str, Any]) -> list[str]:
    figures = next((value for key, value in found.items() if key.startswith("from_")), found)
    return ["–" if figures.get(part) is None else f"{figures[part]:.2f}" for part in _PARTS]


def _notes(figures: Mapping[str, Any]) -> list[str]:
    notes = []
    if not figures["truth"]:
        notes.append(f"no truth in it: figures are differences from {next(iter(figures['filters']))}")
    if not figures["magnetometer"]:
        notes.append("no magnetometer: headings set equal where the movement begins, then free")
    if figures["dropped"]:
        notes.append(f"{figures['dropped']} of {figures['samples']} samples dropped")
    for name, found in figures["filters"].items():
        share = next((part for key, part in found.items() if key.startswith("from_")), found).get("estimated")
        if share is not None and share < 1.0:
            withheld = (
                ": too little for a figure" if share < LEAST_ESTIMATED else ", which is all the figure is of"
            )
            notes.append(f"{name} estimated {100.0 * share:.1f} % of the movement{withheld}")
        if "aligned_words" in found:
            notes.append(f"{name} aligned: {found['aligned_words']}")
    if figures.get("hint"):
        notes.append(f"the truth may be in another frame: {figures['hint']}")
    return notes
