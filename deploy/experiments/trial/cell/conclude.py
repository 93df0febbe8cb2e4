"""The end of a cell: its recording is closed, and the cell is what that recording gives."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from common.errors import RecordingError
from deploy.experiments.trial.cell.judge import judged
from deploy.experiments.trial.cell.plan import CellKey
from deploy.experiments.trial.cell.recomputed import recompute
from deploy.experiments.trial.cell.recording import CellCourse
from deploy.experiments.trial.cell.result import Cell
from deploy.experiments.trial.cell.tape import CellTape, facts_of, head, recording_of
from slave.config import SlaveConfig


def open_tape(
    folder: Path | None, key: CellKey, config: SlaveConfig, settings: Mapping[str, str]
) -> CellTape | None:
    """The recording of a cell in the folder of its trial; None without a folder. Raises TandemError."""
    return None if folder is None else CellTape(recording_of(folder, key), head(key, config, settings))


def conclude(
    key: CellKey,
    course: CellCourse,
    config: SlaveConfig,
    settings: Mapping[str, str],
    ended: Sequence[str],
    tape: CellTape | None,
) -> Cell:
    """Judge a course: by its recording where there is a whole one, so that both say the same for ever.

    `ended`: how processes ended that should not have.
    """
    if tape is None:
        return judged(key, course, config, settings, ended)
    fault = tape.close(facts_of(course, tuple(ended)))
    if not fault:
        try:
            return recompute(tape.path)
        except RecordingError as error:  # the cell is worth more than its recording
            fault = str(error)
    cell = judged(key, course, config, settings, ended)
    return replace(cell, remarks=(*cell.remarks, f"its recording is not whole: {fault}"))
