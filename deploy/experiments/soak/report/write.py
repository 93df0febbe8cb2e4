"""The report of a soak: JSON for machines, one self-contained page for people, the plot beside it."""

from __future__ import annotations

from pathlib import Path

from deploy.experiments.soak.files.options import in_words
from deploy.experiments.soak.judge.judge import JudgedSoak
from deploy.experiments.soak.report.plots import draw
from deploy.measure.verdict import counts
from deploy.report.output import write_json, writing
from deploy.report.page import render

COLUMNS = {
    "fault": "fault",
    "held_s": "holds after, s",
    "stands_s": "stands after, s",
    "flow_s": "commands flow again, s",
    "ready_s": "ready to engage, s",
    "track_s": "engaged → follows, s",
    "engaged": "engaged",
    "done": "follows again",
}
"""Of the table of faults."""


def write_report(judged: JudgedSoak, folder: Path) -> None:
    """Write `report.json`, `soak.png` and `report.html`. Raises TandemError where the disk refuses."""
    tree, plot = judged.tree(), draw(judged.seen)
    write_json(folder / "report.json", tree)
    page = render(
        "deploy.experiments.soak.report",
        "report.html.jinja",
        {},
        **tree,
        lasted=in_words(judged.lasted_s),
        counts=counts(judged.verdicts),
        verdicts=judged.verdicts,
        columns=COLUMNS,
        plot=plot,
    )
    for path, content in ((folder / "soak.png", plot), (folder / "report.html", page.encode())):
        with writing(path):
            path.write_bytes(content)
