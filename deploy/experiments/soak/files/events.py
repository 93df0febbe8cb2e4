"""What happened, line by line in a file as it happens: a soak that is killed leaves it behind."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TextIO

from common.errors import TandemError
from deploy.report.output import writing

FILE = "events.jsonl"


@dataclass(frozen=True, slots=True)
class Event:
    """One line."""

    at_s: float
    """Since the soak's begin."""
    kind: str
    """`begin`, `fault`, `recovered`, `guard`, `engage`, `ended`, `still`, `recording`, `end` …"""
    what: Mapping[str, Any] = field(default_factory=dict)

    def line(self) -> str:
        """As JSON."""
        return json.dumps({"at_s": round(self.at_s, 3), "event": self.kind, **self.what}, ensure_ascii=False)


class EventFile:
    """Events as they come, each on disk at once."""

    def __init__(self, folder: Path) -> None:
        self._path = folder / FILE
        with writing(self._path):
            self._file: TextIO = self._path.open("x", encoding="utf-8", buffering=1)

    def add(self, event: Event) -> None:
        """Write one. Raises TandemError where the disk does not take it."""
        with writing(self._path):
            self._file.write(event.line() + "\n")

    def close(self) -> None:
        """May be called again."""
        self._file.close()


def read_events(folder: Path) -> list[Event]:
    """All events in order; a last line that was cut off is left out. Raises TandemError."""
    path = folder / FILE
    try:
        lines = path.read_text("utf-8", errors="replace").splitlines()
    except OSError as error:
        raise TandemError(f"{path}: cannot be read ({error.strerror}); was a soak there?") from None
    return [event for event in map(_parsed, lines) if event is not None]


def of_kind(events: Sequence[Event], kind: str) -> list[Event]:
    """Those of one kind."""
    return [event for event in events if event.kind == kind]


def _parsed(line: str) -> Event | None:
    try:
        tree = json.loads(line)
        return Event(float(tree.pop("at_s")), str(tree.pop("event")), tree)
    except (ValueError, KeyError, AttributeError):
        return None
