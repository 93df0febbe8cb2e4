"""A simulated drive's PDOs: what their mapping (1600h, 1A00h, …) makes of bytes. Pure, but for SDO aborts."""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping, Sequence

from canopen.sdo.exceptions import SdoAbortedError

from slave.servos.canopen import pdo
from slave.servos.canopen.mapping import INVALID, RPDOS, TPDOS

PdoLayout = tuple[struct.Struct, list[str]]
"""The bytes, and what each value is called in `TAKEN` or `GIVEN`."""
TAKEN = {
    0x6040: "controlword",
    0x607A: "target",
    0x60C1: "target",
    0x6060: "mode",
    0x60FF: "velocity",
    0x60E0: "positive_limit",
    0x60E1: "negative_limit",
    0x6072: "max_torque",
}
GIVEN = {
    0x6041: "statusword", pdo.ENCODER: "encoder", 0x6064: "position", pdo.INPUTS: "inputs",
    pdo.TORQUE: "thousandths", pdo.CURRENT: "thousandths", 0x6061: "mode", 0x606C: "velocity",
}  # fmt: skip
"""The entries that may be mapped, by index."""
_FORMATS = {8: "B", 16: "H", 32: "i"}
_OTHERWISE = {pdo.INPUTS: "I", pdo.TORQUE: "h", pdo.CURRENT: "h"}
_NOT_MAPPABLE = 0x0604_0041
_ID_BITS = 0x7FF
_SYNCHRONOUS = range(1, 241)
"""Transmission types: every so many SYNCs. Other TPDOs would be sent by events, which nothing here has."""


def layout(entries: Sequence[int], known: Mapping[int, str]) -> PdoLayout:
    """The layout of mapped entries (index, subindex, bits). Raises SdoAbortedError for an unknown one."""
    names = [known.get(entry >> 16, "") for entry in entries]
    formats = [_OTHERWISE.get(entry >> 16, _FORMATS.get(entry & 0xFF, "")) for entry in entries]
    if not entries or not all(names) or not all(formats):
        raise SdoAbortedError(_NOT_MAPPABLE)
    return struct.Struct("<" + "".join(formats)), names


class MappedPdos:
    """The PDOs of one drive that are on. `value` gives an entry of its dictionary, by index and subindex."""

    def __init__(self, value: Callable[[int, int], int]) -> None:
        self._value = value
        self._layouts: dict[int, PdoLayout] = {}
        """By the index of their communication parameters."""
        self._ids: dict[int, int] = {}
        """The identifier of each, likewise."""
        self._pending: dict[int, bytes] = {}
        """RPDOs that wait for SYNC, by identifier."""
        self._syncs = 0

    def activate(self, index: int, cob_id: int, count: int | None = None) -> None:
        """A COB-ID is written: the PDO is on, or off. Raises SdoAbortedError for a mapping that cannot be.

        `count`: of its entries; None: as the dictionary says.
        """
        self._layouts.pop(index, None)
        self._ids.pop(index, None)
        if cob_id & INVALID:
            return
        entries, emptied = index + 0x200, count == 0
        count = self._value(entries, 0) if count is None else count
        if not count and emptied:
            return
        mapped = [self._value(entries, sub) for sub in range(1, count + 1)]
        self._layouts[index] = layout(mapped, TAKEN if index in RPDOS else GIVEN)
        self._ids[index] = cob_id & _ID_BITS

    def on(self, index: int) -> bool:
        """Whether a PDO is on, by the index of its communication parameters."""
        return index in self._layouts

    def take(self, frame_id: int, data: bytes) -> bool:
        """An RPDO has come; it waits for SYNC. False: it is none of this drive's."""
        known = any(self._ids.get(index) == frame_id for index in RPDOS)
        if known:
            self._pending[frame_id] = data
        return known

    def taken(self) -> dict[str, int] | None:
        """What has come since the last SYNC; None where an RPDO was of a wrong length."""
        out: dict[str, int] = {}
        for index in RPDOS:
            data = self._pending.pop(self._ids.get(index, -1), None)
            if data is None:
                continue
            form, names = self._layouts[index]
            if len(data) != form.size:
                return None
            out.update(zip(names, form.unpack(data), strict=True))
        return out

    def given(self, now: Mapping[str, int], withheld: str) -> list[tuple[int, bytes]]:
        """The TPDOs of a SYNC, of what the drive says `now`, but for those with the `withheld` value."""
        self._syncs += 1
        out = []
        for index in TPDOS:
            form, names = self._layouts.get(index, (None, []))
            if form is None or withheld in names:
                continue
            every = self._value(index, 2)
            if every in _SYNCHRONOUS and not self._syncs % every:
                out.append((self._ids[index], form.pack(*(now[name] for name in names))))
        return out
