"""What bounds one-way times, in words for a person. Pure."""

from __future__ import annotations

from common.clock_sync import ROUND_TRIP
from common.metrics.slave import OffsetMetrics


def clock_words(clocks: OffsetMetrics | None) -> list[tuple[str, str]]:
    """Lines and their styles: which bound is in use where it is not the usual one, and what was refuted."""
    if clocks is None:
        return []
    words = [(f"clocks: {clocks.words}", "dim")] if clocks.source != ROUND_TRIP else []
    if clocks.contradictions:
        refuted = f"time services contradicted the round trip {clocks.contradictions} times"
        words.append((f"clocks: {refuted}; in use: {clocks.words}", "yellow"))
    if clocks.clock_steps:
        words.append((f"clocks: the robot's reference clock was set {clocks.clock_steps} times", "yellow"))
    return words
