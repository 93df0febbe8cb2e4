"""From what a soak left in its folder to its verdicts: right after it, or after it was killed."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass, replace
from pathlib import Path

from deploy.experiments.soak.files.events import of_kind, read_events
from deploy.experiments.soak.files.happenings import FaultRecovered, HostStalled, SoakEnded
from deploy.experiments.soak.files.samples import read_samples
from deploy.experiments.soak.judge.commands import commands
from deploy.experiments.soak.judge.evidence import SoakEvidence
from deploy.experiments.soak.judge.growth import drift, handles, in_use, memory
from deploy.experiments.soak.judge.processes import ending, loops, recordings
from deploy.experiments.soak.judge.robot import guard, recovery
from deploy.measure.verdict import Verdict, failed

Criterion = Callable[[SoakEvidence], list[Verdict]]
WRONG: tuple[tuple[str, Criterion], ...] = (
    ("soak", ending),
    ("commands", commands),
    ("guard", guard),
    ("recovery", recovery),
    ("loops", loops),
    ("recorder", recordings),
)
"""What must not go wrong, by the heading of the report."""
GROWTH: tuple[tuple[str, Criterion], ...] = (
    ("latency", drift),
    ("memory", memory),
    ("memory", in_use),
    ("handles", handles),
)
"""What must not grow."""


@dataclass(frozen=True, slots=True)
class JudgedSoak:
    """A soak and its verdicts."""

    seen: SoakEvidence
    verdicts: list[Verdict]

    @property
    def ended(self) -> str:
        """How it ended: in its time, interrupted, by an error, or unknown because it was killed."""
        ends = of_kind(self.seen.events, SoakEnded)
        return ends[-1].what.how if ends else "it was killed, so its end is unknown"

    @property
    def lasted_s(self) -> float:
        """From its beginning to its last event, to 0.1 s."""
        return round(max((event.at_s for event in self.seen.events), default=0.0), 1)

    def tree(self) -> dict[str, object]:
        """The report for machines."""
        events = self.seen.events
        faults = [asdict(event.what) for event in of_kind(events, FaultRecovered)]
        return {
            "options": asdict(self.seen.begun),
            "lasted_s": self.lasted_s,
            "ended": self.ended,
            "verdict": "failed" if failed(self.verdicts) else "passed",
            "criteria": [verdict.tree() for verdict in self.verdicts],
            "faults": faults,
            "host_stalls": len(of_kind(events, HostStalled)),
            "samples": len(self.seen.samples),
        }


def verdicts_of(
    seen: SoakEvidence, criteria: Iterable[tuple[str, Criterion]] = (*WRONG, *GROWTH)
) -> list[Verdict]:
    """The verdicts of some criteria, under their headings."""
    return [replace(verdict, group=group) for group, judge in criteria for verdict in judge(seen)]


def judge_soak(folder: Path) -> JudgedSoak:
    """Read a soak's files and judge it. Raises TandemError where there are none."""
    seen = SoakEvidence.of(read_events(folder), read_samples(folder))
    return JudgedSoak(seen, verdicts_of(seen))
