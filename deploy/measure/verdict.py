"""One criterion, judged: what it asks, what was measured, whether that will do, or why nobody can tell."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from enum import StrEnum
from typing import Any

from deploy.measure.estimated import LEAST_ESTIMATED
from deploy.measure.trend import Slope

LEAST_SHARE = 0.2
"""Where less than this is left unexplained, that nothing went wrong in it says little."""


class Status(StrEnum):
    """What came of a criterion."""

    PASS = "pass"
    FAIL = "fail"
    NOT_JUDGED = "not judged"


@dataclass(frozen=True, slots=True)
class Verdict:
    """`figure` beside `limit`, in `unit`; both None where nothing could be measured."""

    group: str
    name: str
    status: Status
    figure: float | None
    limit: float | None
    unit: str = ""
    note: str = ""
    """Where the figure comes from, or why there is none."""

    def tree(self) -> dict[str, Any]:
        """Plain values."""
        return {**asdict(self), "status": str(self.status)}


def at_most(
    group: str, name: str, figure: float | None, limit: float, unit: str = "", note: str = ""
) -> Verdict:
    """Pass where the figure is within the limit, the limit included."""
    if figure is None:
        return Verdict(group, name, Status.NOT_JUDGED, None, limit, unit, note)
    return Verdict(group, name, Status.PASS if figure <= limit else Status.FAIL, figure, limit, unit, note)


def of_enough(verdict: Verdict, share: float) -> Verdict:
    """Not judged instead of passed, where too small a `share` of what there was could have failed."""
    if verdict.status is not Status.PASS or share >= LEAST_SHARE:
        return verdict
    words = f"only {100.0 * share:.0f} % of it was outside of what explains"
    note = f"{words}; {verdict.note}" if verdict.note else words
    return replace(verdict, status=Status.NOT_JUDGED, note=note)


def of_most(verdict: Verdict, share: float) -> Verdict:
    """Not judged instead of passed, where the figure is known for less than LEAST_ESTIMATED of the time."""
    if verdict.status is not Status.PASS or share >= LEAST_ESTIMATED:
        return verdict
    words = f"known for only {100.0 * share:.0f} % of the samples"
    note = f"{words}; {verdict.note}" if verdict.note else words
    return replace(verdict, status=Status.NOT_JUDGED, figure=None, note=note)


def not_above(
    group: str, name: str, slope: Slope | None, limit: float, unit: str, note: str, too_short: str
) -> Verdict:
    """Whether something grows by more than a limit that counts as nothing.

    Pass: with confidence it does not. Fail: with confidence it does. Else the soak was too short to tell.
    """
    if slope is None:
        return Verdict(group, name, Status.NOT_JUDGED, None, limit, unit, too_short)
    words = f"{slope.low:+.3g} to {slope.high:+.3g} with 95 % confidence, {slope.points} points"
    note = f"{words}; {note}" if note else words
    if slope.high <= limit:
        status = Status.PASS
    elif slope.low > limit:
        status = Status.FAIL
    else:
        status, note = Status.NOT_JUDGED, f"too short to tell: {note}"
    return Verdict(group, name, status, slope.value, limit, unit, note)


def failed(verdicts: list[Verdict]) -> list[Verdict]:
    """Those that failed."""
    return [verdict for verdict in verdicts if verdict.status is Status.FAIL]
