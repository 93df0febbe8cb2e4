"""Writes `report.html`, `report.json` and `cells.csv`. Equal cells give equal files."""

from __future__ import annotations

import datetime
import platform
from importlib.metadata import version
from pathlib import Path

from deploy.experiments.trial.cell.folder import Folder, as_json
from deploy.experiments.trial.report.document import as_html
from deploy.experiments.trial.report.findings import Findings, find
from deploy.experiments.trial.report.machine import as_csv, tree
from deploy.experiments.trial.report.plots import plots
from deploy.experiments.trial.report.tasks import TASKS
from deploy.report.output import writing
from deploy.sim.network.namespaces import congestion_control

HTML, JSON, CSV = "report.html", "report.json", "cells.csv"
TASKS_COPY = "tasks.toml"
"""The weights of the ranking, so that whoever has the folder can compute it again."""


def write(folder: Folder, tasks: Path = TASKS) -> Findings:
    """Write the three files and a copy of the tasks. Raises TandemError where the disk does not let them."""
    f = find(folder, tasks)
    about = _about(blinded=bool(f.plan.blinded))
    texts = {
        HTML: as_html(f, plots(f.rows), about),
        JSON: as_json(tree(f, about)),
        CSV: as_csv(cell for row in f.rows for cell in row.cells),
        TASKS_COPY: tasks.read_text("utf-8"),
    }
    for name, text in texts.items():
        with writing(folder.path / name):
            (folder.path / name).write_text(text, "utf-8")
    return f


def _about(blinded: bool) -> dict[str, str]:
    """`blinded`: no transport is named."""
    now = datetime.datetime.now(datetime.UTC)
    about = {
        "written": now.strftime("%Y-%m-%d %H:%M UTC"),
        "tandem": version("tandem"),
        "zenoh": version("eclipse-zenoh"),
        "python": platform.python_version(),
        "kernel": f"{platform.system()} {platform.release()} {platform.machine()}",
        "congestion control": (
            f"tcp, tls, ws: {congestion_control()}, set on both emulated hosts; quic: Zenoh's own; udp: none"
        ),
    }
    if blinded:
        del about["congestion control"]
    return dict(sorted(about.items()))  # as `report.json` has them
