"""What a calibration compares before anything is written: each check, its figure, and what follows from it.

Checks return `CrossCheck`; `refuse_contradictions` turns the first that contradicts into a refusal, so the
checks are to be given in the order of how likely each cause is. What cannot be judged is said, never counted
as good.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

from common.errors import RecordingError

Verdict = Literal["agrees", "contradicts", "not judged"]


@dataclass(frozen=True, slots=True)
class CrossCheck:
    """One comparison of two things that should agree."""

    compared: str
    """What with what, such as "norm of the acceleration against gravity"."""
    figure: float | None
    """How far they are apart, or what was measured; None where it was not."""
    limit: float | None
    """Beyond which they contradict each other."""
    unit: str
    """Of figure and limit; "" for a ratio."""
    verdict: Verdict
    advice: str = ""
    """For a person: what is wrong and what to do; for what was not judged, why."""

    @property
    def contradicts(self) -> bool:
        """Whether it refuses the result."""
        return self.verdict == "contradicts"

    def as_report(self) -> dict[str, object]:
        """For machines."""
        return {
            "compared": self.compared,
            "figure": self.figure,
            "limit": self.limit,
            "unit": self.unit,
            "verdict": self.verdict,
            "advice": self.advice,
        }


def agrees(compared: str, figure: float, limit: float, unit: str = "") -> CrossCheck:
    """Both agree."""
    return CrossCheck(compared, figure, limit, unit, "agrees")


def not_judged(compared: str, why: str) -> CrossCheck:
    """The data do not tell."""
    return CrossCheck(compared, None, None, "", "not judged", why)


def at_most(compared: str, figure: float, limit: float, unit: str = "", *, advice: str) -> CrossCheck:
    """Contradicts where the figure is above the limit, or is no number."""
    verdict: Verdict = "agrees" if figure <= limit else "contradicts"
    return CrossCheck(compared, figure, limit, unit, verdict, "" if verdict == "agrees" else advice)


def refuse_contradictions(evidence: Iterable[CrossCheck]) -> tuple[CrossCheck, ...]:
    """The evidence as it came. Raises RecordingError with the advice of the first that contradicts."""
    judged = tuple(evidence)
    for one in judged:
        if one.verdict == "contradicts":
            raise RecordingError(one.advice)
    return judged


def first_contradiction(evidence: Iterable[CrossCheck]) -> CrossCheck | None:
    """The likeliest cause, for whom a refusal concerns one node of many; None where all is well."""
    return next((one for one in evidence if one.contradicts), None)


def unjudged(evidence: Iterable[CrossCheck]) -> tuple[str, ...]:
    """A note for a person for each comparison that was not possible."""
    return tuple(f"not judged: {e.compared}: {e.advice}" for e in evidence if e.verdict == "not judged")
