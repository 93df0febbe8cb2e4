"""What happened, line by line in a file as it happens: a soak that is killed leaves it behind."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Generic, TextIO, TypeVar

from common.errors import TandemError
from deploy.experiments.soak.files.happenings import Happening, happening
from deploy.report.output import writing

FILE = "events.jsonl"
H = TypeVar("H", bound=Happening, covariant=True)


@dataclass(frozen=True, slots=True)
class SoakEvent(Generic[H]):
    """One line."""

    at_s: float
    """Since the soak's begin."""
    what: H

    def line(self) -> str:
        """As JSON."""
        tree = {"at_s": round(self.at_s, 3), "event": self.what.kind, **self.what.written()}
        return json.dumps(tree, ensure_ascii=False)


AnyEvent = SoakEvent[Happening]


class EventFile:
    """Events as they come, each on disk at once."""

    def __init__(self, folder: Path) -> None:
        self._path = folder / FILE
        with writing(self._path):
            self._file: TextIO = self._path.open("x", encoding="utf-8", buffering=1)

    def add(self, event: AnyEvent) -> None:
        """Write one. Raises TandemError where the disk does not take it."""
        with writing(self._path):
            self._file.write(event.line() + "\n")

    def close(self) -> None:
        """May be called again."""
        self._file.close()


def read_events(folder: Path) -> list[AnyEvent]:
    """All events in order; a last line that was cut off is left out. Raises TandemError."""
    path = folder / FILE
    try:
        lines = path.read_text("utf-8", errors="replace").splitlines()
    except OSError as error:
        raise TandemError(f"{path}: cannot be read ({error.strerror}); was a soak there?") from None
    return [event for event in map(_parsed, lines) if event is not None]


def of_kind(events: Iterable[AnyEvent], kind: type[H]) -> list[SoakEvent[H]]:
    """The events of one kind."""
    return [SoakEvent(event.at_s, event.what) for event in events if isinstance(event.what, kind)]


def _parsed(line: str) -> AnyEvent | None:
    try:
        tree = json.loads(line)
        return SoakEvent(float(tree.pop("at_s")), happening(tree.pop("event"), tree))
    except (ValueError, KeyError, AttributeError, TypeError):
        return None
