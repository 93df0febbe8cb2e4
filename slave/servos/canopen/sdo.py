"""The client's side of expedited SDO transfers, at most 4 bytes each (CiA 301, SDO). Pure."""

from __future__ import annotations

import struct
from dataclasses import dataclass

_DOWNLOAD, _UPLOAD = 0x23, 0x40
"""Command specifiers of a request: write (expedited, size told), read."""
_DOWNLOADED, _UPLOADED, _ABORT = 0x60, 0x43, 0x80
_HEAD = struct.Struct("<BHB")

ABORTS = {
    0x0503_0000: "toggle bit not alternated",
    0x0504_0000: "timed out",
    0x0504_0001: "unknown command",
    0x0601_0000: "access not supported",
    0x0601_0001: "cannot be read",
    0x0601_0002: "cannot be written",
    0x0602_0000: "there is no such object",
    0x0604_0041: "cannot be mapped to a PDO",
    0x0604_0042: "would exceed the PDO's length",
    0x0604_0043: "parameters do not fit together",
    0x0606_0000: "hardware error",
    0x0607_0010: "wrong length",
    0x0607_0012: "too long",
    0x0607_0013: "too short",
    0x0609_0011: "there is no such subindex",
    0x0609_0030: "value out of range",
    0x0609_0031: "value too high",
    0x0609_0032: "value too low",
    0x0800_0000: "general error",
    0x0800_0020: "cannot be stored",
    0x0800_0021: "not while under local control",
    0x0800_0022: "not in the drive's present state",
}
"""Abort codes in words."""


@dataclass(frozen=True, slots=True)
class Write:
    """Set one entry of the object dictionary."""

    index: int
    subindex: int
    size: int
    """Bytes: 1, 2 or 4."""
    value: int
    """Negative values in two's complement."""


@dataclass(frozen=True, slots=True)
class Read:
    """Ask for one entry, which must then hold `expected` in the bits of `mask`."""

    index: int
    subindex: int
    mask: int
    expected: int
    meaning: str
    """What it is, as in "is a CiA 402 drive"."""


Transfer = Write | Read


@dataclass(frozen=True, slots=True)
class Answer:
    """What a drive answered: done, or why not."""

    done: bool
    words: str = ""


def request(transfer: Transfer) -> bytes:
    """The 8 bytes that ask for it."""
    if isinstance(transfer, Read):
        return _HEAD.pack(_UPLOAD, transfer.index, transfer.subindex) + bytes(4)
    command = _DOWNLOAD | (4 - transfer.size) << 2
    value = (transfer.value & (1 << 8 * transfer.size) - 1).to_bytes(4, "little")
    return _HEAD.pack(command, transfer.index, transfer.subindex) + value


def answer(transfer: Transfer, data: bytes) -> Answer | None:
    """What `data` says to this transfer; None where it answers something else."""
    if len(data) != 8:
        return None
    command, index, subindex = _HEAD.unpack_from(data)
    if (index, subindex) != (transfer.index, transfer.subindex):
        return None
    name = f"object {index:04X}:{subindex}"
    value = int.from_bytes(data[4:], "little")
    if command == _ABORT:
        return Answer(False, f"{name}: {ABORTS.get(value, f'aborted with {value:#010x}')}")
    if isinstance(transfer, Write):
        return Answer(True) if command == _DOWNLOADED else None
    if command & 0xE3 != _UPLOADED & 0xE3:
        return None
    # without its size indicated an expedited answer has four bytes
    size = 4 - (command >> 2 & 3) if command & 1 else 4
    value &= (1 << 8 * size) - 1
    if value & transfer.mask == transfer.expected:
        return Answer(True)
    return Answer(False, f"{name} is {value:#x}: {transfer.meaning} expected")
