"""What every process publishes: its software, its loop's ticks, its heap, and summaries of durations."""

from __future__ import annotations

from dataclasses import dataclass

from common.metrics.tree import Metrics


@dataclass(frozen=True, slots=True)
class Summary(Metrics):
    """A distribution of durations, in ms. The figures are None where nothing was recorded."""

    count: int
    mean: float | None = None
    p50: float | None = None
    p99: float | None = None
    max: float | None = None
    bound: float | None = None
    """Half-width of the clock offset's bound, for a stage that crosses from one clock to the other."""

    @property
    def total(self) -> float:
        """The sum of all durations, in ms."""
        return self.count * self.mean if self.mean is not None else 0.0


@dataclass(frozen=True, slots=True)
class Software(Metrics):
    """Versions that a process runs."""

    tandem: str
    schema: int
    """Of the messages."""
    zenoh: str
    python: str


@dataclass(frozen=True, slots=True)
class Ticks(Metrics):
    """Turns of a periodic loop since its start."""

    expected: int
    missed: int


@dataclass(frozen=True, slots=True)
class HeapMetrics(Metrics):
    """Memory that a process holds on to, beside which resident memory may hide a leak."""

    bytes_in_use: int | None
    """Allocated by C and not freed; None where the C library does not report it."""
    python_blocks: int
    """Objects of Python's own allocator."""
    python_threads: int
