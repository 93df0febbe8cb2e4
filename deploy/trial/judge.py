"""A course into a cell: its figures, its pictures' data, its remarks. Pure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from deploy.trial.cell import Cell, Status
from deploy.trial.measure import excerpt, measure, one_way_percentiles_ms
from deploy.trial.plan import CellKey
from deploy.trial.recording import Course, counts, echoes
from slave.config import SlaveConfig


def judged(
    key: CellKey, course: Course, config: SlaveConfig, settings: Mapping[str, str], remarks: Sequence[str]
) -> Cell:
    """`config` is the slave's, for its limits; `remarks` come after the course's own.

    A course in which no command was heard, or none was accepted, failed: its figures are true of nothing.
    """
    if not course.judged.commands or not echoes(course.judged.states):
        seen = "was heard" if not course.judged.commands else "was accepted"
        why = f"no command {seen} in the judged time: nothing to judge"
        return Cell(key, Status.FAILED, why, remarks=(*course.remarks, *remarks), settings=settings)
    return Cell(
        key=key,
        status=Status.DONE,
        values=measure(course, config),
        remarks=(*course.remarks, *remarks),
        settings=settings,
        counts=counts(course.judged),
        one_way_ms=one_way_percentiles_ms(course.judged),
        excerpt=excerpt(course.judged, config),
    )
