"""Computes a trial's tables again from its recordings, and compares them with the cells and the report.

A cell's figures are computed from its recording alone. Where a trial kept no recordings, the tables are
computed from the cells' files, which proves less: what a cell says is then taken for true.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from common.errors import RecordingError, TandemError
from common.recording import check_recording
from deploy.experiments.trial.cell.folder import Folder
from deploy.experiments.trial.cell.plan import CellKey
from deploy.experiments.trial.cell.recomputed import recompute
from deploy.experiments.trial.cell.result import Cell, CellStatus
from deploy.experiments.trial.cell.tape import RECORDINGS, recording_of
from deploy.experiments.trial.report.document import as_html
from deploy.experiments.trial.report.findings import Findings, find
from deploy.experiments.trial.report.machine import as_csv, tree
from deploy.experiments.trial.report.plots import plots
from deploy.experiments.trial.report.tasks import TASKS
from deploy.experiments.trial.report.write import CSV, HTML, JSON, TASKS_COPY

_IMAGE = re.compile(r'src="data:image/[^"]*"')
"""A plot: other versions of its library draw a curve in other bytes. Its title and caption are compared."""


@dataclass(frozen=True, slots=True)
class TrialChecked:
    """What verifying found."""

    differences: list[str]
    """In words; empty where everything is what the recordings give."""
    recomputed: int
    """Cells computed from their recordings."""
    cells: int


def differences(
    folder: Folder, tasks: Path | None = None, show: Callable[[str], None] = lambda _: None
) -> TrialChecked:
    """What of cells and report is not what the recordings give. Raises TandemError without a report.

    `tasks`: other weights than those in the folder. `show`: which cell is computed now.
    """
    copy = folder.path / TASKS_COPY
    weights = tasks or (copy if copy.exists() else TASKS)
    written = folder.cells()
    found, again = _recomputed(folder.path, written, show)
    given = "recordings give" if again else "cells give"
    findings = find(folder, weights, {**written, **again}.values())
    found += _tables_apart(folder.path, findings, given)
    return TrialChecked(found, len(again), len(written))


def _recomputed(
    folder: Path, written: Mapping[CellKey, Cell], show: Callable[[str], None]
) -> tuple[list[str], dict[CellKey, Cell]]:
    """What is wrong with recordings and cells, in words; and the cells that recordings give."""
    if not (folder / RECORDINGS).exists():
        return [], {}
    found, again = [], {}
    for key, cell in written.items():
        path = recording_of(folder, key)
        show(key.slug)
        if not path.exists():
            if cell.status is CellStatus.DONE:
                found.append(f"{RECORDINGS}/{path.name}: is missing, and its cell has figures")
            continue
        found += _broken(path)
        try:
            again[key] = recompute(path)
        except RecordingError as error:
            if cell.status is CellStatus.DONE:
                found.append(f"{RECORDINGS}/{error}")
            continue
        if again[key].key != key:
            found.append(f"{RECORDINGS}/{path.name}: it is the recording of {again.pop(key).key.slug}")
            continue
        told, computed = (json.loads(json.dumps(one.tree())) for one in (cell, again[key]))
        again[key] = Cell.of_tree(computed)  # rounded, as the report read it
        for name in _apart(told, computed, ""):
            found.append(f"cells/{key.slug}.json: {name[1:]} is not what the recording gives")
    known = {recording_of(folder, key) for key in written}
    strangers = sorted(set((folder / RECORDINGS).iterdir()) - known)
    return found + [f"{RECORDINGS}/{path.name}: there is no cell of it" for path in strangers], again


def _broken(path: Path) -> list[str]:
    """What the chain of hashes in a recording says."""
    checked = check_recording(path)
    return [f"{RECORDINGS}/{path.name}: {checked.broken}"] if checked.broken else []


def _tables_apart(folder: Path, findings: Findings, given: str) -> list[str]:
    try:
        table, page = ((folder / name).read_text("utf-8") for name in (CSV, HTML))
        report = json.loads((folder / JSON).read_text("utf-8"))
        compared, about = report["compared"], dict(report["about"])
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise TandemError(f"{folder}: there is no report that can be read ({error})") from None
    again = as_csv(cell for row in findings.rows for cell in row.cells)
    computed = json.loads(json.dumps(tree(findings, {})["compared"]))
    tables = as_html(findings, plots(findings.rows), about)
    return [
        *_lines_apart(CSV, table, again, given),
        *(f"{JSON}: {path} is not what the {given}" for path in _apart(compared, computed, "compared")),
        *_lines_apart(HTML, page, tables, given),
    ]


def _without_images(text: str) -> list[tuple[int, str]]:
    """The lines with their numbers, less empty ones, and less what plots are drawn of."""
    return [(n, _IMAGE.sub("", line)) for n, line in enumerate(text.splitlines(), start=1) if line]


def _lines_apart(name: str, old: str, new: str, given: str) -> Iterator[str]:
    lines, again = _without_images(old), _without_images(new)
    for (number, line), (_, other) in zip(lines, again, strict=False):
        if line != other:
            yield f"{name}: line {number} is not what the {given}"
    if len(lines) != len(again):
        yield f"{name}: has {len(lines)} lines, the {given} {len(again)}"


def _apart(one: object, other: object, path: str) -> list[str]:
    if isinstance(one, Mapping) and isinstance(other, Mapping):
        keys = sorted({*one, *other})
        return [words for key in keys for words in _apart(one.get(key), other.get(key), f"{path}.{key}")]
    if isinstance(one, list) and isinstance(other, list) and len(one) == len(other):
        pairs = zip(one, other, strict=True)
        return [words for i, (a, b) in enumerate(pairs) for words in _apart(a, b, f"{path}[{i}]")]
    return [] if one == other else [path]
