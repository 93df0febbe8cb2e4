"""What a maker's EDS or DCF file (CiA 306) says of his drive: its objects, and how they may be used."""

from __future__ import annotations

import re
from configparser import ConfigParser, Error
from dataclasses import dataclass, field
from pathlib import Path

from slave.servos.canopen.sdo import Read, Transfer

_OBJECT = re.compile(r"([0-9a-f]{4})(?:sub([0-9a-f]{1,2}))?", re.IGNORECASE)
_ARRAY_TYPES = (0x8, 0x9)
"""ARRAY and RECORD: a section of theirs is no entry, their subindices are."""
_BITS = {0x1: 8, 0x2: 8, 0x3: 16, 0x4: 32, 0x5: 8, 0x6: 16, 0x7: 32, 0x15: 64, 0x1B: 64}
"""CiA 301's data types: BOOLEAN, INTEGER8, 16, 32, UNSIGNED8, 16, 32, INTEGER64, UNSIGNED64."""


class EdsError(ValueError):
    """A text for why a file is no EDS."""


@dataclass(frozen=True, slots=True)
class EdsEntry:
    """One entry of an object dictionary."""

    access: str
    """`ro`, `rw`, `wo`, `const`, …"""
    bits: int | None
    """None: of another type than integers."""
    value: int | None
    """A DCF's value, else the default; None where the file names none."""


@dataclass(frozen=True, slots=True)
class Eds:
    """One file."""

    name: str
    vendor: int | None
    product: int | None
    entries: dict[tuple[int, int], EdsEntry] = field(repr=False)

    def refusal(self, transfer: Transfer) -> str:
        """Why a drive of this file refuses a transfer; empty where it takes it."""
        name = f"object {transfer.index:04X}:{transfer.subindex}"
        entry = self.entries.get((transfer.index, transfer.subindex))
        if entry is None:
            return f"{name}: not in {self.name}"
        if isinstance(transfer, Read):
            return f"{name}: {self.name} says that it cannot be read" if entry.access == "wo" else ""
        if entry.access in ("ro", "const"):
            return f"{name}: {self.name} says that it cannot be written"
        if entry.bits is not None and entry.bits != 8 * transfer.size:
            return f"{name}: wrong length: {self.name} says {entry.bits} bits"
        return ""

    def value(self, place: tuple[int, int]) -> int | None:
        """What an entry holds, by index and subindex, as far as the file says."""
        entry = self.entries.get(place)
        return None if entry is None else entry.value


def read_eds(path: Path) -> Eds:
    """Read a file. Raises EdsError."""
    parser = ConfigParser(interpolation=None, strict=False, inline_comment_prefixes=None)
    try:
        # makers' files are often Latin-1; only their texts are beyond ASCII, and none is needed here
        parser.read_string(path.read_text("latin-1"))
    except OSError as error:
        raise EdsError(f"a readable EDS file ({error.strerror})") from None
    except Error as error:
        raise EdsError(f"an EDS file ({str(error).splitlines()[0]})") from None
    entries = {}
    for section in parser.sections():
        found = _OBJECT.fullmatch(section.strip())
        if found is None:
            continue
        table = parser[section]
        kind = _number(table.get("ObjectType", "0x7"))
        if found[2] is None and kind in _ARRAY_TYPES:
            continue
        value = _number(table.get("ParameterValue", "") or table.get("DefaultValue", ""))
        bits = _BITS.get(_number(table.get("DataType", "")) or 0)
        place = int(found[1], 16), int(found[2] or "0", 16)
        entries[place] = EdsEntry(table.get("AccessType", "rw").strip().lower(), bits, value)
    if (0x1000, 0) not in entries:
        raise EdsError("an EDS file, with a section [1000] and one for each object of the drive")
    about = parser["DeviceInfo"] if parser.has_section("DeviceInfo") else {}
    vendor, product = (_number(about.get(key, "")) for key in ("VendorNumber", "ProductNumber"))
    return Eds(path.name, vendor or None, product or None, entries)


def _number(text: str) -> int | None:
    """A number as EDS files write it; `$NODEID+0x180` without the node's id; None for other text."""
    words = [word.strip() for word in text.upper().split("+") if word.strip() != "$NODEID"]
    if not text.strip():
        return None
    try:
        return sum(int(word, 8 if re.fullmatch(r"0[0-7]+", word) else 0) for word in words) if words else 0
    except ValueError:
        return None
