"""Targets as data: where a value stands in a report, and the most that it may be."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from deploy.measure.accuracy import SIDES
from deploy.measure.verdict import Verdict, at_most


@dataclass(frozen=True, slots=True)
class ReportTarget:
    """One value of a report and its limit."""

    name: str
    path: tuple[str, ...]
    """Keys from the top of the report to the value; `*` in a key stands for each side, the worse counts."""
    limit: float
    unit: str = ""


def judge_targets(report: Mapping[str, object], targets: Iterable[ReportTarget]) -> list[Verdict]:
    """A verdict for each target; not judged where the report does not hold the value."""
    return [at_most(t.name, _worse_side(report, t.path), t.limit, t.unit) for t in targets]


def _worse_side(report: object, path: tuple[str, ...]) -> float | None:
    """The larger of both sides. A side that is in the report without a value leaves nothing to judge."""
    found = [_value(report, tuple(key.replace("*", side) for key in path)) for side in SIDES]
    if None in found:
        return None
    return max((value for value in found if isinstance(value, float)), default=None)


class _AbsentSide:
    """Stands for a side that the robot does not have."""


def _value(report: object, path: tuple[str, ...]) -> float | _AbsentSide | None:
    for i, key in enumerate(path):
        if not isinstance(report, Mapping):
            return None
        if key not in report and i and key.startswith(SIDES):
            return _AbsentSide()
        report = report.get(key)
    return float(report) if isinstance(report, int | float) and not isinstance(report, bool) else None
