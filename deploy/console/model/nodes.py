"""Which of the operator's nodes needs attention, from what the master counts. Pure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

SOUND_PERCENT = 99.0
"""A node that answered less of the last second's windows needs attention."""
_WORSE = {"unknown": 0, "ok": 1, "attention": 2, "silent": 3}
_WINDOWS = ("fresh", "late", "lost")
_TROUBLES = {
    "bad_checksum": "{} frames with a wrong checksum",
    "bad_tick": "{} frames of another tick",
    "bad_length": "{} frames of a wrong length",
    "faults": "said {} times that its sensor is faulty",
    "saturated": "{} readings at the end of the range",
    "resets": "its own count began anew {} times",
    "rate_changes": "its rate changed {} times",
}
"""Counters that must not grow, and the words where one did."""


@dataclass(frozen=True, slots=True)
class NodeQuality:
    """One node in the last second."""

    name: str
    level: str
    """`ok`, `attention`, `silent` or `unknown`."""
    answered_percent: float | None
    """Share of the windows that it answered soundly."""
    lost: int
    """Windows in which it was lost, since the master's start."""
    words: str


class NodeWatch:
    """Takes the master's counters once a second."""

    def __init__(self, names: Sequence[str]) -> None:
        self._names = names
        self._before: Mapping[str, Mapping[str, int]] | None = None
        self._told: set[str] = set()
        """Nodes of which it was told that they need attention."""
        self.qualities: list[NodeQuality] = [NodeQuality(name, "unknown", None, 0, "") for name in names]

    def on_counters(self, nodes: Mapping[str, Mapping[str, int]], doubts: Mapping[str, str]) -> list[str]:
        """Counters since the start, by node. Returns a line for each node that became worse, or well again.

        A master that started anew counts from 0: its first second is then compared with nothing.
        """
        before, self._before = self._before, nodes
        if before is None or _fell(before, nodes):
            before = {}
        old = {quality.name: quality.level for quality in self.qualities}
        self.qualities = [
            _judge(name, nodes.get(name, {}), before.get(name, {}), doubts.get(name, ""))
            for name in self._names
        ]
        return [line for quality in self.qualities if (line := self._line(quality, old[quality.name]))]

    def _line(self, quality: NodeQuality, before: str) -> str:
        """What is new, in words; empty where nothing is. How a node begins is no news."""
        name = quality.name
        if quality.level == "ok" and name in self._told:
            self._told.discard(name)
            return f"{name}: answers as it should"
        if _WORSE[quality.level] > max(_WORSE[before], _WORSE["ok"]) and before != "unknown":
            self._told.add(name)
            return f"{name}: {quality.words}"
        return ""

    def forget(self) -> None:
        """Nothing is heard of the nodes any more."""
        self._before = None
        self.qualities = [NodeQuality(name, "unknown", None, 0, "") for name in self._names]

    def shown(self) -> list[dict[str, object]]:
        """As the page has them."""
        return [
            {
                "name": each.name,
                "level": each.level,
                "answered_percent": each.answered_percent,
                "lost": each.lost,
                "words": each.words,
            }
            for each in self.qualities
        ]


def _fell(before: Mapping[str, Mapping[str, int]], nodes: Mapping[str, Mapping[str, int]]) -> bool:
    return any(
        nodes.get(name, {}).get(counter, 0) < value
        for name, counters in before.items()
        for counter, value in counters.items()
    )


def _judge(name: str, now: Mapping[str, int], before: Mapping[str, int], doubt: str) -> NodeQuality:
    grown = {counter: value - before.get(counter, 0) for counter, value in now.items()}
    windows = sum(grown.get(counter, 0) for counter in _WINDOWS)
    lost = now.get("lost", 0)
    if not windows:
        return NodeQuality(name, "attention" if doubt else "unknown", None, lost, doubt)
    fresh = grown.get("fresh", 0)
    answered = 100.0 * fresh / windows
    words = [doubt] if doubt else []
    words += [text.format(grown[counter]) for counter, text in _TROUBLES.items() if grown.get(counter)]
    if answered < SOUND_PERCENT:
        words.insert(0, "silent" if not fresh else f"answered {answered:.0f} % of the windows")
    level = "silent" if not fresh else "attention" if words else "ok"
    return NodeQuality(name, level, round(answered, 1), lost, "; ".join(words))
