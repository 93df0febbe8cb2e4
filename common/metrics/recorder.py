"""What `tandem record` writes when it stops."""

from __future__ import annotations

from dataclasses import dataclass

from common.metrics.tree import Metrics


@dataclass(frozen=True, slots=True)
class RecorderMetrics(Metrics):
    """`tandem record`."""

    recorded: dict[str, int]
    """Messages, by topic."""
    files: list[str]
    put: int
    written: int
    refused: int
    lost: int
    failed: str
    overwritten: int
    """Messages that a newer one replaced before they were taken."""
    missing: dict[str, int]
    """Messages that never came, by their own numbers, by topic."""
