"""Computes a trial's tables again from its cells, and compares them with the report in its folder."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

from common.errors import TandemError
from deploy.experiments.trial.cell.folder import Folder
from deploy.experiments.trial.report.findings import find
from deploy.experiments.trial.report.machine import as_csv, tree
from deploy.experiments.trial.report.tasks import TASKS
from deploy.experiments.trial.report.write import CSV, JSON


def differences(folder: Folder, tasks: Path = TASKS) -> list[str]:
    """What of the report is not what the cells give, in words; empty where all is. Raises TandemError."""
    findings = find(folder, tasks)
    found = []
    try:
        table = (folder.path / CSV).read_text("utf-8")
        report = json.loads((folder.path / JSON).read_text("utf-8"))["compared"]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise TandemError(f"{folder.path}: there is no report that can be read ({error})") from None
    again = as_csv(cell for row in findings.rows for cell in row.cells)
    pairs = zip(table.splitlines(), again.splitlines(), strict=False)
    for number, (old, new) in enumerate(pairs, start=1):
        if old != new:
            found.append(f"{CSV}: line {number} is not what the cells give")
    if len(table.splitlines()) != len(again.splitlines()):
        found.append(f"{CSV}: has {len(table.splitlines())} lines, the cells give {len(again.splitlines())}")
    computed = json.loads(json.dumps(tree(findings, {})["compared"]))
    return found + [
        f"{JSON}: {path} is not what the cells give" for path in _apart(report, computed, "compared")
    ]


def _apart(one: object, other: object, path: str) -> list[str]:
    if isinstance(one, Mapping) and isinstance(other, Mapping):
        keys = sorted({*one, *other})
        return [words for key in keys for words in _apart(one.get(key), other.get(key), f"{path}.{key}")]
    if isinstance(one, list) and isinstance(other, list) and len(one) == len(other):
        pairs = zip(one, other, strict=True)
        return [words for i, (a, b) in enumerate(pairs) for words in _apart(a, b, f"{path}[{i}]")]
    return [] if one == other else [path]
