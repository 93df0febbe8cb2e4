"""Marks of what happens while something is recorded: lines of JSON in a folder, which recorders read."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from enum import StrEnum
from pathlib import Path

from common.clock import Clock, monotonic_ns, wall_ns
from common.errors import TandemError

MARKS = "marks.jsonl"
"""The file, in a session's folder or in that of `[recording]`."""
MARK_TOPIC = "session/mark"
"""Under which a recording holds the marks, each a line of JSON."""
NOW_TOPIC = "session/now"
"""Once a second: subject, session and step, so that any part of a recording says of what it is."""


class MarkKind(StrEnum):
    """What a mark says."""

    STEP = "step"
    """A step of the protocol begins."""
    EVENT = "event"
    ANSWERS = "answers"
    """A questionnaire was answered; the text is JSON (`deploy.study.answers`)."""
    END = "end"


@dataclass(frozen=True, slots=True)
class Mark:
    """One line."""

    wall_ns: int
    """ns since 1970."""
    monotonic_ns: int
    """This host's monotonic clock, as in the recordings."""
    kind: MarkKind
    text: str

    def line(self) -> str:
        """As it stands in the file, and in a recording."""
        return json.dumps(asdict(self), ensure_ascii=False)


def write_mark(
    folder: Path, kind: MarkKind, text: str, wall: Clock = wall_ns, clock: Clock = monotonic_ns
) -> Mark:
    """Write a mark down. Raises OSError."""
    mark = Mark(wall(), clock(), kind, text)
    # one write, so that two who mark at once never mix their lines
    descriptor = os.open(folder / MARKS, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o640)
    try:
        os.write(descriptor, f"{mark.line()}\n".encode())
    finally:
        os.close(descriptor)
    return mark


def read_marks(folder: Path) -> list[Mark]:
    """All, in order. Raises TandemError where a line is none."""
    path = folder / MARKS
    if not path.exists():
        return []
    found, text = [], path.read_text("utf-8").removesuffix("\n")
    # not splitlines: a mark's text may hold what Unicode counts as the end of a line
    for number, line in enumerate(text.split("\n") if text else (), start=1):
        try:
            tree = json.loads(line)
            found.append(Mark(tree["wall_ns"], tree["monotonic_ns"], MarkKind(tree["kind"]), tree["text"]))
        except (ValueError, KeyError, TypeError):
            raise TandemError(f"{path}: line {number} is no mark") from None
    return found


class NewMarks:
    """The marks of a folder that came since the last look."""

    def __init__(self, folder: Path, all_of_them: bool) -> None:
        """`all_of_them`: also those that are there already."""
        self.folder = folder
        self._size = 0
        self._taken = 0 if all_of_them else len(read_marks(folder))

    def take(self) -> Sequence[Mark]:
        """Each once. Raises TandemError where a line is none."""
        try:
            size = (self.folder / MARKS).stat().st_size
        except OSError:
            return ()
        if size == self._size:
            return ()
        new = read_marks(self.folder)[self._taken :]
        self._size, self._taken = size, self._taken + len(new)
        return new
