"""A course into a cell: its figures, its pictures' data, its remarks. Pure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from deploy.experiments.trial.cell.measure import excerpt, measure, one_way_percentiles_ms
from deploy.experiments.trial.cell.plan import CellKey
from deploy.experiments.trial.cell.recording import CellCourse, counts, echoes, times_in_force
from deploy.experiments.trial.cell.result import Cell, CellStatus
from slave.config import SlaveConfig


def judged(
    key: CellKey, course: CellCourse, config: SlaveConfig, settings: Mapping[str, str], remarks: Sequence[str]
) -> Cell:
    """`config` is the slave's, for its limits; `remarks` come after the course's own.

    A course in which no command was heard, or none was accepted, failed: its figures are true of nothing.
    """
    why = _nothing_to_judge(course)
    if why:
        return Cell(key, CellStatus.FAILED, why, remarks=(*course.remarks, *remarks), settings=settings)
    return Cell(
        key=key,
        status=CellStatus.DONE,
        values=measure(course, config),
        remarks=(*course.remarks, *times_in_force(course.judged), *remarks),
        settings=settings,
        counts=counts(course.judged),
        one_way_ms=tuple(one_way_percentiles_ms(course.judged)),
        excerpt=excerpt(course.judged, config),
    )


def _nothing_to_judge(course: CellCourse) -> str:
    """Why, in words; empty where there is something."""
    if not course.judged.commands:
        return "no command was heard in the judged time: nothing to judge"
    if not echoes(course.judged.states):
        return "no command was accepted in the judged time: nothing to judge"
    if course.after is not None and not course.after.states:
        return "the robot sent nothing after the outage: what it did is unknown"
    return ""
