"""The scores of `tandem accuracy FILE...` as a table."""

from __future__ import annotations

from pathlib import Path

from rich.console import Group, RenderableType
from rich.text import Text

from deploy.experiments.accuracy.judge import PARTS, AccuracyReport, RecordingScores
from deploy.measure.estimated import LEAST_ESTIMATED
from deploy.report.tables import number, plain_table


def accuracy_of_files(report: AccuracyReport) -> RenderableType:
    """A row for each recording and filter, the mean below them, then notes on single files."""
    heads = ("filter", "total", "heading", "inclin.", "µs a sample")
    table = plain_table("recording", *heads, title="RMSE while moving, °")
    table.columns[1].justify = "left"
    notes = []
    for path, scores in report.files.items():
        name = Path(path).stem
        notes += [Text(f"{name}: {note}", "yellow") for note in _notes(scores)]
        for filter_, found in scores.filters.items():
            cells = [number(getattr(found.score, f"{part}_deg", None), 2) for part in PARTS]
            table.add_row(name, filter_, *cells, f"{found.us_per_sample['median']:.1f}")
            name = ""
    if len(report.files) > 1:
        table.add_section()
        for filter_, mean in report.mean.items():
            table.add_row("mean", filter_, *(number(value, 2) for value in mean.values()), "", style="bold")
    return Group(table, *notes)


def _notes(scores: RecordingScores) -> list[str]:
    notes = []
    if not scores.truth:
        notes.append(f"no truth in it: figures are differences from {scores.reference}")
    if not scores.magnetometer:
        notes.append("no magnetometer: headings set equal where the movement begins, then free")
    if scores.dropped:
        notes.append(f"{scores.dropped} of {scores.samples} samples dropped")
    for name, found in scores.filters.items():
        share = 1.0 if found.score is None else found.score.estimated
        if share < 1.0:
            little = share < LEAST_ESTIMATED
            withheld = ": too little for a figure" if little else ", which is all the figure is of"
            notes.append(f"{name} estimated {100.0 * share:.1f} % of the movement{withheld}")
        if found.aligned is not None:
            notes.append(f"{name} aligned: {found.aligned.words()}")
    if scores.hint:
        notes.append(f"the truth may be in another frame: {scores.hint}")
    return notes
