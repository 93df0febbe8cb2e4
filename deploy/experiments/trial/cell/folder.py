"""The report's folder: `plan.json`, and under `cells/` a file a cell, written whole as soon as it is done."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from pathlib import Path

from common.errors import TandemError
from deploy.experiments.trial.cell.plan import CellKey, TrialPlan, check_continues, merged
from deploy.experiments.trial.cell.result import Cell
from deploy.report.output import writing

PLAN = "plan.json"


class Folder:
    """The folder of one trial."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._cells = path / "cells"

    def begin(self, plan: TrialPlan) -> TrialPlan:
        """Store a plan, merged with the one that is there already; returns the plan of all cells.

        Raises TandemError where the folder holds cells of a plan that this one does not continue.
        """
        before = self._plan()
        if before is not None:
            check_continues(before, plan)
            plan = merged(before, plan)
        with writing(self._cells):
            self._cells.mkdir(parents=True, exist_ok=True)
        _write(self.path / PLAN, plan.tree())
        return plan

    def plan(self) -> TrialPlan:
        """The plan of the trial in this folder. Raises TandemError where there is none."""
        plan = self._plan()
        if plan is None:
            raise TandemError(f"{self.path}: there is no trial's {PLAN}; `tandem trial --report {self.path}`")
        return plan

    def cells(self) -> dict[CellKey, Cell]:
        """All that are written. Raises TandemError for a file that is none."""
        found = {}
        for file in sorted(self._cells.glob("*.json")):
            try:
                cell = Cell.of_tree(_read(file))
            except TandemError as error:
                raise TandemError(f"{file}: {error}; remove it to run the cell again") from None
            if (
                file.stem != cell.key.slug
            ):  # else one of two files of a cell would be judged, and the other shown
                raise TandemError(
                    f"{file}: it holds the cell {cell.key.slug}; remove it, or give it that name"
                )
            found[cell.key] = cell
        return found

    def keep(self, cell: Cell) -> None:
        """Write it, whole or not at all."""
        _write(self._cells / f"{cell.key.slug}.json", cell.tree())

    def _plan(self) -> TrialPlan | None:
        file = self.path / PLAN
        return TrialPlan.of_tree(_read(file)) if file.exists() else None


def as_json(tree: Mapping[str, object]) -> str:
    """With sorted keys, so that two reports can be compared line by line."""
    return json.dumps(tree, indent=1, sort_keys=True, ensure_ascii=False, allow_nan=False) + "\n"


def _write(path: Path, tree: Mapping[str, object]) -> None:
    beside = path.with_suffix(".part")
    with writing(path):
        beside.write_text(as_json(tree), "utf-8")
        os.replace(beside, path)  # noqa: PTH105  # one step: a half-written cell is never read


def _read(path: Path) -> object:
    try:
        tree: object = json.loads(path.read_text("utf-8"))
    except OSError as error:
        raise TandemError(f"{path}: cannot be read ({error.strerror or error})") from None
    except ValueError as error:
        raise TandemError(f"{path}: not JSON ({error})") from None
    return tree
