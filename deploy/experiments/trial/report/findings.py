"""What a report holds, read and judged from the cells of a folder."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from deploy.experiments.trial.cell.folder import Folder
from deploy.experiments.trial.cell.plan import TrialPlan
from deploy.experiments.trial.cell.result import Cell
from deploy.experiments.trial.report.ranking import Ranking, rankings
from deploy.experiments.trial.report.spread import SetupResults, rows
from deploy.experiments.trial.report.targets import judge
from deploy.experiments.trial.report.tasks import TASKS, load_tasks
from deploy.measure.verdict import Verdict


@dataclass(frozen=True, slots=True)
class Findings:
    """What a report holds."""

    plan: TrialPlan
    rows: list[SetupResults]
    rankings: list[Ranking]
    judged: list[Verdict]


def find(folder: Folder, tasks: Path = TASKS, cells: Iterable[Cell] | None = None) -> Findings:
    """Read and judge the cells: those given, else those of the folder's files.

    Raises TandemError where there is no trial, ConfigError for the tasks.
    """
    plan = folder.plan()
    found = rows(plan, folder.cells().values() if cells is None else cells)
    return Findings(plan, found, rankings(load_tasks(tasks), found), judge(found, outage=plan.outage_s > 0.0))
