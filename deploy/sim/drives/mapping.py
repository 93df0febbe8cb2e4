"""What a PDO's mapping (1600h, 1A00h, …) makes of its bytes. Pure, but for the SDO abort that refuses one."""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence

from canopen.sdo.exceptions import SdoAbortedError

from slave.servos.canopen import pdo

PdoLayout = tuple[struct.Struct, list[str]]
"""The bytes, and what each value is called in `TAKEN` or `GIVEN`."""
TAKEN = {0x6040: "controlword", 0x607A: "target"}
GIVEN = {
    0x6041: "statusword", pdo.ENCODER: "encoder", 0x6064: "position", pdo.INPUTS: "inputs",
    pdo.TORQUE: "thousandths", pdo.CURRENT: "thousandths",
}  # fmt: skip
"""The entries that may be mapped, by index."""
_FORMATS = {8: "B", 16: "H", 32: "i"}
_OTHERWISE = {pdo.INPUTS: "I", pdo.TORQUE: "h", pdo.CURRENT: "h"}
_NOT_MAPPABLE = 0x0604_0041


def layout(entries: Sequence[int], known: Mapping[int, str]) -> PdoLayout:
    """The layout of mapped entries (index, subindex, bits). Raises SdoAbortedError for an unknown one."""
    names = [known.get(entry >> 16, "") for entry in entries]
    formats = [_OTHERWISE.get(entry >> 16, _FORMATS.get(entry & 0xFF, "")) for entry in entries]
    if not entries or not all(names) or not all(formats):
        raise SdoAbortedError(_NOT_MAPPABLE)
    return struct.Struct("<" + "".join(formats)), names
