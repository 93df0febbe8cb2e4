"""The text of an EDS or DCF file, as makers' tools write it: sections of keys, whatever surrounds them."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

_OBJECT = re.compile(r"([0-9a-f]{4})(?:sub([0-9a-f]{1,2}))?")
_BYTE_ORDER_MARKS = {b"\xff\xfe": "utf-16", b"\xfe\xff": "utf-16", b"\xef\xbb\xbf": "utf-8-sig"}


class EdsError(ValueError):
    """A text for why a file is no EDS."""


@dataclass(frozen=True, slots=True)
class EdsSection:
    """One section: its name and its keys, both in lower case."""

    name: str
    keys: dict[str, str]

    @property
    def place(self) -> tuple[int, int] | None:
        """Index and subindex of the object that it describes; None: of none."""
        found = _OBJECT.fullmatch(self.name)
        return None if found is None else (int(found[1], 16), int(found[2] or "0", 16))

    def text(self, key: str) -> str:
        """A value without quotes and comment; empty where there is none."""
        return self.keys.get(key, "").partition(";")[0].strip().strip('"').strip()

    def number(self, key: str) -> int | None:
        """A value as a number; None where it is none."""
        return number(self.text(key))


def sections(path: Path) -> dict[str, EdsSection]:
    """The sections of a file by name. Of a key or a section that comes twice the later one counts.

    Raises EdsError.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise EdsError(f"a readable EDS file ({error.strerror})") from None
    # makers' files are often Latin-1; only their texts are beyond ASCII, and none is needed here
    encoding = next((name for mark, name in _BYTE_ORDER_MARKS.items() if data.startswith(mark)), "latin-1")
    text = data.decode(encoding, errors="replace")
    if text.lstrip().startswith("<"):
        raise EdsError(
            "an EDS or DCF file, which begins with a section in brackets; this is XML (XDD): export an EDS"
        )
    out: dict[str, EdsSection] = {}
    section = EdsSection("", {})
    for line in map(str.strip, text.splitlines()):
        if line.startswith("[") and "]" in line:
            name = line[1 : line.index("]")].strip().lower()
            section = out.setdefault(name, EdsSection(name, {}))
        elif "=" in line and not line.startswith((";", "#")):
            key, _, value = line.partition("=")
            section.keys[key.strip().lower()] = value.strip()
    return out


def number(text: str) -> int | None:
    """A number as EDS files write it; of `$NODEID+0x180` what is added to the id; None for other text."""
    words = [word.strip() for word in text.upper().split("+") if word.strip() != "$NODEID"]
    if not text.strip():
        return None
    try:
        return sum(int(word, 8 if re.fullmatch(r"0[0-7]+", word) else 0) for word in words) if words else 0
    except ValueError:
        return None
