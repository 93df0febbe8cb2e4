"""How makers' drives differ within the standards: the options of a simulated drive. Pure."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum

_UNSIZED, _SEGMENTED, _LENGTH_INDICATED = 0x42, 0x40, 0x01
_UPLOAD_BITS, _UPLOADED, _EXPEDITED = 0xE0, 0x40, 0x02
_ASK_SEGMENT, _TOGGLE, _ABORT, _TOGGLE_ERROR = 0x60, 0x10, 0x80, 0x0503_0000
_SEGMENT_BYTES = 7

GUARDING = frozenset({0x100C, 0x100D})
INTERPOLATED = frozenset({0x60C0, 0x60C1})
MORE_PDOS = frozenset({0x1401, 0x1402, 0x1403, 0x1601, 0x1602, 0x1603, 0x1803, 0x1A03})
NOT_TANDEMS = frozenset({0x1006, 0x1019, *GUARDING, *INTERPOLATED, *MORE_PDOS, 0x606C, 0x60FF}) - {
    0x1401,
    0x1601,
}
"""Objects of `drive.eds` that makers' drives have, and tandem's own does not."""


class ReadForm(Enum):
    """The form in which a drive answers an SDO read of up to four bytes (CiA 301)."""

    SIZED = "expedited, size indicated: 4F, 4B, 47, 43"
    UNSIZED = "expedited, size not indicated: 42"
    SEGMENTED = "segmented, length indicated: 41"
    SEGMENTED_UNSIZED = "segmented, length not indicated: 40"


@dataclass(slots=True)
class Traits:
    """The options of one drive."""

    knows_16: bool = True
    """Whether "enable operation" leads out of quick stop active: transition 16, which is optional."""
    read_form: ReadForm = ReadForm.SIZED
    answers_after_ns: int = 0
    """How long it takes to answer an SDO request."""
    lacks: frozenset[int] = NOT_TANDEMS
    """Objects that it has not, such as 6077h."""
    read_only: frozenset[int] = frozenset()
    """Objects that it has, but lets nobody write."""
    fixed_ids: frozenset[int] = frozenset()
    """Communication parameters (1400h, …) of PDOs whose entries may be changed, but not their identifier."""
    presets: Mapping[tuple[int, int], int] = field(default_factory=dict)
    """What entries hold after a start, by index and subindex."""
    never_set: int = 0
    """Bits of the statusword that it does not have."""
    always_set: int = 0
    """Bits of the statusword, such as a maker's own 14 and 15, that it always shows."""
    boots_again_after_ns: int = 0
    """How long after its boot-up message it sends a second one; 0: it sends one."""
    longest_period_ms: int = 0
    """The longest that 60C2h:1 takes; 0: any."""
    wide_period: bool = False
    """Whether 60C2h:1 has 16 bits."""
    boots_after_ns: int = 0
    """How long it is dead after power comes."""
    mode_after_syncs: int = 0
    """How many SYNCs it takes until it is in the mode asked for."""
    homed: bool = True
    """Whether its zero is known; with an encoder that is not absolute only after homing."""
    polarity: int = 0
    """607Eh. What the joint's position is already takes bit 7 in; what the torque is, does not."""


class Reformed:
    """Turns the answers of one SDO server into another form, and serves the segments itself."""

    def __init__(self) -> None:
        self._rest = b""
        self._toggle = 0
        self._serving = False

    def answer(self, data: bytes, form: ReadForm) -> bytes:
        """An answer of the server, as a drive of this form gives it."""
        command = data[0]
        if form is ReadForm.SIZED or command & (_UPLOAD_BITS | _EXPEDITED) != _UPLOADED | _EXPEDITED:
            return data
        if form is ReadForm.UNSIZED:
            return bytes([_UNSIZED]) + data[1:]
        size = 4 - (command >> 2 & 3)
        self._rest, self._toggle, self._serving = data[4 : 4 + size], 0, True
        if form is ReadForm.SEGMENTED:
            return bytes([_SEGMENTED | _LENGTH_INDICATED]) + data[1:4] + size.to_bytes(4, "little")
        return bytes([_SEGMENTED]) + data[1:4] + bytes(4)

    def segment(self, request: bytes) -> bytes | None:
        """The segment that a request asks for; None where the request is the server's to answer."""
        if not self._serving:
            return None
        if request[0] & ~_TOGGLE != _ASK_SEGMENT:
            self._serving = False
            return None
        if request[0] & _TOGGLE != self._toggle:
            self._serving = False
            return bytes([_ABORT, 0, 0, 0]) + _TOGGLE_ERROR.to_bytes(4, "little")
        part, self._rest = self._rest[:_SEGMENT_BYTES], self._rest[_SEGMENT_BYTES:]
        self._serving = bool(self._rest)
        head = self._toggle | (_SEGMENT_BYTES - len(part)) << 1 | (not self._rest)
        self._toggle ^= _TOGGLE
        return bytes([head]) + part.ljust(_SEGMENT_BYTES, b"\0")
