"""Doubts about nodes that answer: the one form in which every part of the master states them.

A part gives `{node: NodeDoubt}`. The pipeline puts the parts together. From there a doubt reaches the joints'
validity, the log, the statistics (`doubts`), `tandem status` and, if heavy enough, the refusal of `engage`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum

from common.clock import to_ns

MOST_NAMED = 3
"""Number of nodes that a refusal names; the others are counted."""
_AGAIN_S = 10.0
"""Time until changed words for the same node are logged again: numbers in them change every tick."""


class Weight(IntEnum):
    """The consequence of a doubt; each includes the ones before it."""

    NOTED = 0
    """Logged and shown."""
    INVALID = 1
    """The node's joints are not valid: the robot holds them."""
    REFUSED = 2
    """Engaging is refused while it lasts. A robot that is engaged stays so: its invalid joints are held."""


@dataclass(frozen=True, slots=True)
class NodeDoubt:
    """What is wrong with one node, in words that follow its name and a colon."""

    words: str
    weight: Weight


Doubts = Mapping[str, NodeDoubt]
"""By node (segment)."""


def together(*parts: Doubts) -> dict[str, NodeDoubt]:
    """All doubts about each node in one: the heaviest first, with its weight."""
    out: dict[str, NodeDoubt] = {}
    for part in parts:
        for node, doubt in part.items():
            before = out.get(node)
            if before is None:
                out[node] = doubt
                continue
            first, second = sorted((before, doubt), key=lambda each: -each.weight)
            out[node] = NodeDoubt(f"{first.words}; {second.words}", first.weight)
    return out


def refusal(doubts: Doubts) -> str:
    """Why engaging is refused now, in words; empty where it is not."""
    by_words: dict[str, list[str]] = {}
    for node, doubt in doubts.items():
        if doubt.weight is Weight.REFUSED:
            by_words.setdefault(doubt.words, []).append(node)
    return "; ".join(f"{_names(nodes)}: {words}" for words, nodes in by_words.items())


def _names(nodes: list[str]) -> str:
    more = len(nodes) - MOST_NAMED
    return ", ".join(nodes[:MOST_NAMED]) + (f" and {more} more" if more > 0 else "")


def as_figures(doubts: Doubts) -> dict[str, str]:
    """The words alone, by node, for statistics."""
    return {node: doubt.words for node, doubt in doubts.items()}


class DoubtLog:
    """Lines for the log: when a doubt begins, changes its weight or ends, and at times its newer words."""

    def __init__(self) -> None:
        self._logged: dict[str, tuple[NodeDoubt, int]] = {}

    def lines(self, doubts: Doubts, now_ns: int) -> list[str]:
        """What to log now."""
        if not doubts and not self._logged:
            return []
        new: dict[NodeDoubt, list[str]] = {}
        for node, doubt in doubts.items():
            logged, logged_ns = self._logged.get(node, (None, 0))
            if logged == doubt:
                continue
            stale = now_ns - logged_ns > to_ns(_AGAIN_S)
            if logged is None or logged.weight != doubt.weight or stale:
                self._logged[node] = doubt, now_ns
                new.setdefault(doubt, []).append(node)
        out = [
            f"node {_names(nodes)}: {doubt.words}{_CONSEQUENCE[doubt.weight]}" for doubt, nodes in new.items()
        ]
        gone = [name for name in self._logged if name not in doubts]
        for node in gone:
            del self._logged[node]
        return [*out, f"node {_names(gone)}: believed again"] if gone else out


_CONSEQUENCE = {
    Weight.NOTED: "",
    Weight.INVALID: " (its joints are invalid)",
    Weight.REFUSED: " (its joints are invalid; engage is refused)",
}
