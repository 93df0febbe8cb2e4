"""The progress of a trial and the time that is left."""

from __future__ import annotations

from dataclasses import dataclass, field

from rich.console import RenderableType
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from common.clock import to_s
from deploy.experiments.trial.cell.plan import CellKey, TrialPlan

AROUND_S = 22.0
"""The guess, before the first cell, for what a cell takes beside its judged time: start, align, stop."""
AGAIN_S = 8.0
"""The time to come back after an outage."""


@dataclass(slots=True)
class Progress:
    """Counts cells and averages their times."""

    plan: TrialPlan
    total: int
    """Cells to run now."""
    skipped: int = 0
    """Already there."""
    done: int = 0
    failed: int = 0
    doing: str = ""
    words: str = ""
    _took_s: list[float] = field(default_factory=list)
    _began_ns: int = 0

    def begin(self, key: CellKey, now_ns: int) -> None:
        """The next cell."""
        setup = key.setup
        self.doing = f"{setup.profile}, {setup.name}, repeat {key.repetition} of {self.plan.repeat}"
        self.words = ""
        self._began_ns = now_ns

    def end(self, ran: bool, failed: bool, now_ns: int) -> None:
        """A cell is over; `ran`: whether its time helps to predict the others'."""
        self.done += 1
        self.failed += failed
        if ran:
            self._took_s.append(to_s(now_ns - self._began_ns))

    def left_s(self, now_ns: int) -> float:
        """The time until all cells are done, from the average of those before."""
        if self.done >= self.total:
            return 0.0
        each_s = sum(self._took_s) / len(self._took_s) if self._took_s else self._guess_s()
        spent_s = min(to_s(now_ns - self._began_ns), each_s) if self._began_ns else 0.0
        return max(0.0, (self.total - self.done) * each_s - spent_s)

    def _guess_s(self) -> float:
        outage_s = self.plan.outage_s
        return self.plan.seconds + AROUND_S + (outage_s + AGAIN_S if outage_s else 0.0)


def draw(progress: Progress, now_ns: int) -> RenderableType:
    """Two lines: the progress, and what is being done."""
    p = progress
    head = Table.grid(padding=(0, 2))
    beside = f"{p.done} of {p.total} cells"
    if p.skipped:
        beside += f" ({p.skipped} were there)"
    head.add_row(
        ProgressBar(total=max(1, p.total), completed=p.done, width=28),
        Text(beside),
        Text(f"{clock(p.left_s(now_ns))} left"),
        Text(f"{p.failed} failed", "yellow") if p.failed else Text(""),
    )
    lines = Table.grid()
    lines.add_row(head)
    lines.add_row(Text(f"{p.doing}: {p.words}" if p.words else p.doing, "dim"))
    return lines


def clock(seconds: float) -> str:
    """`1:02:03` or `2:03`."""
    minutes, second = divmod(round(seconds), 60)
    hours, minute = divmod(minutes, 60)
    return f"{hours}:{minute:02d}:{second:02d}" if hours else f"{minute}:{second:02d}"
