"""From what a soak left in its folder to its verdicts: right after it, or after it was killed."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from deploy.experiments.soak.criteria import CRITERIA, Seen
from deploy.experiments.soak.events import of_kind, read_events
from deploy.experiments.soak.explain import explanation
from deploy.experiments.soak.growth import GROWTH
from deploy.experiments.soak.samples import read_samples
from deploy.measure.verdict import Status, Verdict


@dataclass(frozen=True, slots=True)
class Judged:
    """A soak and its verdicts."""

    seen: Seen
    verdicts: list[Verdict]

    def count(self, status: Status) -> int:
        """How many criteria ended so."""
        return sum(verdict.status is status for verdict in self.verdicts)

    @property
    def ended(self) -> str:
        """How it ended: in its time, interrupted, by an error, or unknown because it was killed."""
        ends = of_kind(self.seen.events, "end")
        return str(ends[-1].what.get("how", "")) if ends else "it was killed: nothing says how it ended"

    def tree(self) -> dict[str, Any]:
        """The report for machines."""
        events = self.seen.events
        faults = [event.what for event in of_kind(events, "recovered")]
        return {
            "options": dict(self.seen.options),
            "lasted_s": round(max((event.at_s for event in events), default=0.0), 1),
            "ended": self.ended,
            "verdict": "fail" if self.count(Status.FAIL) else "pass",
            "criteria": [verdict.tree() for verdict in self.verdicts],
            "faults": faults,
            "host_stalls": len(of_kind(events, "still")),
            "samples": len(self.seen.samples),
        }


def judge(folder: Path) -> Judged:
    """Read a soak's files and judge it. Raises TandemError where there are none."""
    events, samples = read_events(folder), read_samples(folder)
    seen = Seen(events, samples, explanation(events, samples))
    verdicts = [verdict for criterion in (*CRITERIA, *GROWTH) for verdict in criterion(seen)]
    return Judged(seen, verdicts)
