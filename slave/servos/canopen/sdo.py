"""The client's side of SDO transfers (CiA 301, SDO protocol). Pure.

Writes are expedited, at most 4 bytes each. A read may be answered in any form that the standard has:
expedited with its size (4Fh, 4Bh, 47h, 43h), expedited without (42h), or segmented with its length (41h) or
without (40h).
"""

from __future__ import annotations

import struct
from dataclasses import dataclass

_DOWNLOAD, _UPLOAD = 0x23, 0x40
"""Command specifiers of a request: write (expedited, with its size), read."""
_DOWNLOADED, _UPLOADED, _ABORT = 0x60, 0x40, 0x80
"""Command specifiers of an answer; the lower bits of an upload's tell its form."""
_EXPEDITED, _SIZED, _UPLOAD_BITS = 0x02, 0x01, 0xE0
_ASK_SEGMENT, _TOGGLE, _LAST = 0x60, 0x10, 0x01
_MOST_BYTES = 4096
"""The limit of a segmented read: no entry that is asked for here is longer than some tens of bytes."""
_HEAD = struct.Struct("<BHB")
TOGGLE_ERROR = 0x0503_0000

ABORTS = {
    0x0503_0000: "toggle bit not alternated",
    0x0504_0000: "timed out",
    0x0504_0001: "unknown command",
    0x0504_0002: "invalid block size",
    0x0504_0003: "invalid sequence number",
    0x0504_0004: "wrong checksum",
    0x0504_0005: "out of memory",
    0x0601_0000: "access not supported",
    0x0601_0001: "cannot be read",
    0x0601_0002: "cannot be written",
    0x0602_0000: "there is no such object",
    0x0604_0041: "cannot be mapped to a PDO",
    0x0604_0042: "would exceed the PDO's length",
    0x0604_0043: "parameters do not fit together",
    0x0604_0047: "incompatible inside of the device",
    0x0606_0000: "hardware error",
    0x0607_0010: "wrong length",
    0x0607_0012: "too long",
    0x0607_0013: "too short",
    0x0609_0011: "there is no such subindex",
    0x0609_0030: "value out of range",
    0x0609_0031: "value too high",
    0x0609_0032: "value too low",
    0x0609_0036: "the maximum is less than the minimum",
    0x060A_0023: "a resource is not available",
    0x0800_0000: "general error",
    0x0800_0020: "cannot be stored",
    0x0800_0021: "not while under local control",
    0x0800_0022: "not in the drive's present state",
    0x0800_0023: "the drive has no object dictionary",
    0x0800_0024: "there is no data",
}
"""The text of each abort code."""


@dataclass(frozen=True, slots=True)
class Write:
    """Set one entry of the object dictionary."""

    index: int
    subindex: int
    size: int
    """Bytes: 1, 2 or 4."""
    value: int
    """Negative values in two's complement."""
    part_of: str = ""
    """Of something that a drive may lack: where one transfer of it is refused, the others are left out."""


@dataclass(frozen=True, slots=True)
class Read:
    """Ask for one entry, which must then hold `expected` in the bits of `mask`."""

    index: int
    subindex: int
    mask: int
    expected: int
    meaning: str
    """What it is, as in "is a CiA 402 drive"."""
    optional: bool = False
    """Whether a drive may lack the entry."""
    again: int = 0
    """How often to ask again while it does not hold what is expected: it takes a drive a while."""
    part_of: str = ""
    """As of a `Write`."""


Transfer = Write | Read


@dataclass(frozen=True, slots=True)
class SdoAnswer:
    """What a drive answered: done, or why not."""

    done: bool
    words: str = ""
    data: bytes = b""
    """The content of an entry that was read, as many bytes as the drive sent."""


@dataclass(frozen=True, slots=True)
class More:
    """A segmented read goes on: send `request`."""

    request: bytes


def request(transfer: Transfer) -> bytes:
    """The 8 bytes that ask for it."""
    if isinstance(transfer, Read):
        return _HEAD.pack(_UPLOAD, transfer.index, transfer.subindex) + bytes(4)
    command = _DOWNLOAD | (4 - transfer.size) << 2
    value = (transfer.value & (1 << 8 * transfer.size) - 1).to_bytes(4, "little")
    return _HEAD.pack(command, transfer.index, transfer.subindex) + value


def answer(transfer: Transfer, data: bytes) -> SdoAnswer | None:
    """What `data` says to this transfer; None where it answers something else, or goes on in segments."""
    found = Exchange(transfer).on_answer(data)
    return found if isinstance(found, SdoAnswer) else None


class Exchange:
    """One transfer from its request to its last answer."""

    def __init__(self, transfer: Transfer) -> None:
        self._transfer = transfer
        self._segments: bytearray | None = None
        """What came so far of a segmented read; None where none is under way."""
        self._length: int | None = None
        self._toggle = 0
        self.strange = ""
        """A text for an answer to this transfer in a form that is not in CiA 301."""

    def begin(self) -> bytes:
        """The first request, also to begin all over."""
        self._segments = None
        return request(self._transfer)

    def on_answer(self, data: bytes) -> SdoAnswer | More | None:
        """What these bytes say; None where they answer something else, or are no answer."""
        if len(data) != 8:
            return None
        if self._segments is not None and data[0] & _UPLOAD_BITS == 0:
            return self._on_segment(data)
        command, index, subindex = _HEAD.unpack_from(data)
        transfer = self._transfer
        if (index, subindex) != (transfer.index, transfer.subindex):
            return None
        value = int.from_bytes(data[4:], "little")
        if command == _ABORT:
            return SdoAnswer(False, f"{self._name}: {ABORTS.get(value, f'aborted with {value:#010x}')}")
        if isinstance(transfer, Write):
            if command == _DOWNLOADED:
                return SdoAnswer(True)
        elif command & _UPLOAD_BITS == _UPLOADED:
            return self._on_upload(command, data[4:])
        self.strange = f"{self._name} is answered with command {command:02X}h, which is no answer to it"
        return None

    def _on_upload(self, command: int, payload: bytes) -> SdoAnswer | More:
        if command & _EXPEDITED:
            # without its size an expedited answer has four bytes, the value's own among them
            size = 4 - (command >> 2 & 3) if command & _SIZED else 4
            return self._judge(payload[:size])
        self._segments, self._toggle = bytearray(), 0
        self._length = int.from_bytes(payload, "little") if command & _SIZED else None
        return More(bytes([_ASK_SEGMENT]) + bytes(7))

    def _on_segment(self, data: bytes) -> SdoAnswer | More:
        assert self._segments is not None
        if data[0] & _TOGGLE != self._toggle:
            self._segments = None
            return SdoAnswer(False, f"{self._name}: {ABORTS[TOGGLE_ERROR]}")
        self._segments += data[1 : 8 - (data[0] >> 1 & 7)]
        if len(self._segments) > _MOST_BYTES:
            self._segments = None
            return SdoAnswer(False, f"{self._name}: longer than {_MOST_BYTES} bytes")
        if not data[0] & _LAST:
            self._toggle ^= _TOGGLE
            return More(bytes([_ASK_SEGMENT | self._toggle]) + bytes(7))
        held, self._segments = bytes(self._segments), None
        if self._length is not None and len(held) != self._length:
            return SdoAnswer(False, f"{self._name}: {len(held)} bytes received, {self._length} announced")
        return self._judge(held)

    def _judge(self, held: bytes) -> SdoAnswer:
        transfer = self._transfer
        assert isinstance(transfer, Read)
        value = int.from_bytes(held, "little")
        if value & transfer.mask == transfer.expected:
            return SdoAnswer(True, data=bytes(held))
        return SdoAnswer(False, f"{self._name} is {value:#x}: {transfer.meaning} expected", bytes(held))

    @property
    def _name(self) -> str:
        return f"object {self._transfer.index:04X}:{self._transfer.subindex}"
