"""What a maker's EDS or DCF file (CiA 306) says of his drive: its objects, and how they may be used."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from slave.servos.canopen.eds_text import EdsError, EdsSection, number, sections
from slave.servos.canopen.sdo import Read, Transfer, Write

__all__ = ["Eds", "EdsEntry", "EdsError", "read_eds"]

_ARRAY_TYPES = (0x8, 0x9)
"""ARRAY and RECORD: a section of theirs is no entry, their subindices are."""
_BITS = {0x1: 8, 0x2: 8, 0x3: 16, 0x4: 32, 0x5: 8, 0x6: 16, 0x7: 32, 0x15: 64, 0x1B: 64}
"""CiA 301's data types: BOOLEAN, INTEGER8, 16, 32, UNSIGNED8, 16, 32, INTEGER64, UNSIGNED64."""
_MAPPINGS = (range(0x1600, 0x1800), range(0x1A00, 0x1C00))
_COMMUNICATION = {"nrofrxpdo": 0x1400, "nroftxpdo": 0x1800}
_COMPACT_BITS = (32, 8, 16, 8, 16)
"""Of a PDO's communication parameters: identifier, type, inhibit time, reserved, event timer."""
_COMPACT_ENTRIES = 8
_MOST_PDOS = 512

Place = tuple[int, int]
"""Index and subindex."""


@dataclass(frozen=True, slots=True)
class EdsEntry:
    """One entry of an object dictionary."""

    access: str
    """`ro`, `rw`, `wo`, `const`, …"""
    bits: int | None
    """None: of another type than integers."""
    value: int | None
    """A DCF's value, else the default; None where the file names none."""
    of_node: bool = False
    """Whether the node's id is to be added to the value (`$NODEID`)."""
    mappable: bool = True
    """False: the file says that no PDO can hold it."""


@dataclass(frozen=True, slots=True)
class Eds:
    """One file."""

    name: str
    vendor: int | None
    product: int | None
    entries: dict[Place, EdsEntry] = field(repr=False)

    def refusal(self, transfer: Transfer) -> str:
        """Why a drive of this file refuses a transfer; empty where it takes it.

        LowLimit and HighLimit do not count: files say 65535 of 1016h:1, which holds a node's id above that.
        """
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
        return self._unmappable(transfer)

    def _unmappable(self, transfer: Write) -> str:
        if transfer.subindex == 0 or not any(transfer.index in one for one in _MAPPINGS):
            return ""
        index, subindex = transfer.value >> 16 & 0xFFFF, transfer.value >> 8 & 0xFF
        mapped = self.entries.get((index, subindex))
        if mapped is None or mapped.mappable:
            return ""
        return f"object {index:04X}:{subindex}: {self.name} says that no PDO holds it"

    def value(self, place: Place, node_id: int = 0) -> int | None:
        """What an entry of a node holds, by index and subindex, as far as the file says."""
        entry = self.entries.get(place)
        if entry is None or entry.value is None:
            return None
        return entry.value + (node_id if entry.of_node else 0)


def read_eds(path: Path) -> Eds:
    """Read a file. Raises EdsError."""
    read = sections(path)
    device = read.get("deviceinfo", EdsSection("deviceinfo", {}))
    entries = _compact_pdos(device)
    for name, section in read.items():
        place = section.place
        if place is None:
            continue
        compact = section.number("compactsubobj") or 0
        if place[1] == 0 and compact and "sub" not in name:
            entries |= _compact(place[0], section, read.get(f"{name}value"), min(compact, 254))
        elif "sub" in name or section.number("objecttype") not in _ARRAY_TYPES:
            entries[place] = _entry(section)
    if (0x1000, 0) not in entries:
        raise EdsError("an EDS file, with a section [1000] and one for each object of the drive")
    vendor, product = device.number("vendornumber"), device.number("productnumber")
    return Eds(path.name, vendor or None, product or None, entries)


def _entry(section: EdsSection) -> EdsEntry:
    text = section.text("parametervalue") or section.text("defaultvalue")
    bits = _BITS.get(section.number("datatype") or 0)
    mappable = section.number("pdomapping") != 0
    return EdsEntry(
        section.text("accesstype").lower() or "rw", bits, number(text), "$NODEID" in text.upper(), mappable
    )


def _compact(index: int, section: EdsSection, values: EdsSection | None, count: int) -> dict[Place, EdsEntry]:
    """`CompactSubObj`: subindices of one kind, whose values stand in a section of their own."""
    each = _entry(section)
    mapping = any(index in one for one in _MAPPINGS)
    entries = {(index, 0): EdsEntry(each.access if mapping else "ro", 8, count)}
    for sub in range(1, count + 1):
        text = "" if values is None else values.text(str(sub))
        entries[index, sub] = (
            EdsEntry(each.access, each.bits, number(text), "$NODEID" in text.upper(), each.mappable)
            if text
            else each
        )
    return entries


def _compact_pdos(device: EdsSection) -> dict[Place, EdsEntry]:
    """`CompactPDO`: which parameters each PDO has, where the file has no sections for them."""
    mask, entries = device.number("compactpdo") or 0, {}
    for key, first in _COMMUNICATION.items() if mask else ():
        for index in range(first, first + min(device.number(key) or 0, _MOST_PDOS)):
            for sub, bits in enumerate(_COMPACT_BITS, 1):
                if mask >> sub - 1 & 1:
                    entries[index, sub] = EdsEntry("rw", bits, None)
            for sub in range(_COMPACT_ENTRIES + 1):
                entries[index + 0x200, sub] = EdsEntry("rw", 32 if sub else 8, None)
    return entries
