"""Text tables as programs write them: some lines of their own, one line of names, then numbers."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

import numpy as np

from common.errors import RecordingError
from common.quaternion import Array

_DELIMITERS = (",", ";", "\t", None)
"""None: any white space."""
_MOST_PRELUDE = 200
_MOST_TORN = 0.1
"""Share of lines that may be torn or hold no numbers; beyond that the file is not what it seems."""
_DECIMAL_COMMA = re.compile(r"^-?\d+,\d+(e[-+]?\d+)?$", re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class TextTable:
    """Columns of numbers by name, and the lines before them."""

    prelude: tuple[str, ...]
    names: tuple[str, ...]
    values: Array
    """(T, columns); NaN where a cell holds no number."""
    notes: tuple[str, ...]

    def column(self, name: str) -> Array:
        """(T,) of the column of that name, or KeyError."""
        try:
            return self.values[:, self.names.index(name)]
        except ValueError:
            raise KeyError(name) from None


def read_text(path: Path) -> str:
    """The text of a file in UTF-8, UTF-16 or Latin-1. Raises RecordingError."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read ({error.strerror or error})") from None
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return data.decode("utf-16", errors="replace")
    if b"\0" in data[:4096]:
        raise RecordingError(f"{path}: is not a text file")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("latin-1")


def read_table(path: Path) -> TextTable:
    """The table of a file. Raises RecordingError where there is no line of names above rows of numbers."""
    return parse_table(str(path), read_text(path))


def parse_table(where: str, text: str) -> TextTable:
    """The table in a text; `where` begins each error."""
    lines = text.splitlines()
    head = _head(lines)
    if head is None:
        raise RecordingError(
            f"{where}: expected a line of column names above rows of numbers; found none in the first "
            f"{_MOST_PRELUDE} lines"
        )
    at, delimiter = head
    names = [name.strip().strip('"') for name in _split(lines[at].lstrip("#/% "), delimiter)]
    width = len(names)
    rows, torn = [], 0
    for line in lines[at + 1 :]:
        if not line.strip() or line.lstrip().startswith(("#", "//")):
            continue
        cells = _split(line, delimiter)
        if len(cells) == width + 1 and not cells[-1]:
            cells.pop()  # a delimiter at the end of the line
        row = [_number(cell, delimiter) for cell in cells]
        if len(cells) != width or all(np.isnan(row)):
            torn += 1
        else:
            rows.append(row)
    if len(rows) < 2 or torn > _MOST_TORN * len(rows):
        raise RecordingError(
            f"{where}: {torn} of {torn + len(rows)} lines are not rows of {width} numbers "
            f"({', '.join(names[:4])}, …)"
        )
    notes = (f"{where}: {torn} torn lines left out",) if torn else ()
    return TextTable(tuple(lines[:at]), tuple(names), np.array(rows, dtype=np.float64), notes)


def _head(lines: Sequence[str]) -> tuple[int, str | None] | None:
    """Where the names are, and what separates cells: the first line of words with numbers right below."""
    for at, line in enumerate(lines[:_MOST_PRELUDE]):
        below = next((text for text in lines[at + 1 : at + 3] if text.strip()), "")
        for delimiter in _DELIMITERS:
            names = [n.strip() for n in _split(line.lstrip("#/% "), delimiter)]
            cells = _split(below, delimiter)
            if len(cells) == len(names) + 1 and not cells[-1]:
                cells.pop()
            if len(names) < 2 or len(cells) != len(names) or not all(names):
                continue
            words = sum(bool(np.isnan(_number(name, delimiter))) for name in names)
            numbers = sum(not np.isnan(_number(cell, delimiter)) for cell in cells)
            if words == len(names) and numbers >= 0.5 * len(cells):
                return at, delimiter
    return None


def _split(line: str, delimiter: str | None) -> list[str]:
    if delimiter is None:
        return line.split()
    return next(csv.reader([line], delimiter=delimiter, skipinitialspace=True), [])


def _number(text: str, delimiter: str | None) -> float:
    text = text.strip()
    if delimiter != "," and _DECIMAL_COMMA.match(text):
        text = text.replace(",", ".")
    try:
        return float(text)
    except ValueError:
        pass
    if len(text) >= 19 and text[4:5] == "-":
        try:
            return datetime.fromisoformat(text).timestamp()
        except ValueError:
            pass
    return float("nan")
