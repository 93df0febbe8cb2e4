"""Marks of what happens while something is recorded: lines of JSON in a folder, which recorders read."""

from __future__ import annotations

import errno
import json
import logging
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

log = logging.getLogger(__name__)


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
    """Write a mark down. Raises OSError, also where the disk took a part of it alone."""
    mark = Mark(wall(), clock(), kind, text)
    # one write, so that two who mark at once never mix their lines
    descriptor = os.open(folder / MARKS, os.O_RDWR | os.O_APPEND | os.O_CREAT, 0o640)
    try:
        size = os.fstat(descriptor).st_size
        torn = size > 0 and os.pread(descriptor, 1, size - 1) != b"\n"
        line = f"{chr(10) * torn}{mark.line()}\n".encode()
        if os.write(descriptor, line) != len(line):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    finally:
        os.close(descriptor)
    return mark


def read_marks(folder: Path) -> list[Mark]:
    """All, in order. Raises TandemError where a line is none."""
    marks, wrong = look_at_marks(folder)
    if wrong:
        raise TandemError(f"{folder / MARKS}: line {wrong[0]} is no mark")
    return marks


def look_at_marks(folder: Path) -> tuple[list[Mark], list[int]]:
    """All that can be read, and the numbers of the lines that cannot, such as one that a full disk cut off.

    Raises TandemError where the file itself cannot be read.
    """
    found, wrong = list[Mark](), list[int]()
    try:
        content = (folder / MARKS).read_bytes().removesuffix(b"\n")
    except FileNotFoundError:
        return found, wrong
    except OSError as error:
        raise TandemError(f"{folder / MARKS}: cannot be read ({error.strerror})") from None
    # not splitlines: a mark's text may hold what Unicode counts as the end of a line
    for number, line in enumerate(content.split(b"\n") if content else (), start=1):
        try:
            tree = json.loads(line)
            found.append(Mark(tree["wall_ns"], tree["monotonic_ns"], MarkKind(tree["kind"]), tree["text"]))
        except (ValueError, KeyError, TypeError):
            wrong.append(number)
    return found, wrong


class NewMarks:
    """The marks of a folder that came since the last look."""

    def __init__(self, folder: Path, all_of_them: bool) -> None:
        """`all_of_them`: also those that are there already."""
        self.folder = folder
        self._size = 0
        self._taken = 0 if all_of_them else len(look_at_marks(folder)[0])

    def take(self) -> Sequence[Mark]:
        """Each once; a line that is none is passed over, for a recording goes on without it."""
        try:
            size = (self.folder / MARKS).stat().st_size
        except OSError:
            return ()
        if size == self._size:
            return ()
        try:
            marks, wrong = look_at_marks(self.folder)
        except TandemError as error:
            log.warning("%s", error)
            return ()
        if wrong:
            log.warning("%s: line %d is no mark, and is passed over", self.folder / MARKS, wrong[0])
        new = marks[self._taken :]
        self._size, self._taken = size, self._taken + len(new)
        return new
