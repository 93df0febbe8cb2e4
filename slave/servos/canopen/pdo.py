"""What SYNC moves: one RPDO to and one TPDO from each drive, packed for all drives at once. Pure."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from common.wire.messages import Mask

NMT, SYNC, EMERGENCY, TPDO1, RPDO1 = 0x000, 0x080, 0x080, 0x180, 0x200
SDO_ANSWER, SDO_REQUEST, HEARTBEAT = 0x580, 0x600, 0x700
"""Function codes of CiA 301's predefined connection set; a node's id is added to all but NMT and SYNC."""

ENCODER = 0x2000
"""Manufacturer's object: the output encoder's word."""
RPDO_MAPPING = (0x6040_0010, 0x607A_0020)
"""Controlword, target position: as entries of 1600h (index, subindex, bits)."""
TPDO_MAPPING = (0x6041_0010, ENCODER << 16 | 0x0010, 0x6064_0020)
"""Statusword, encoder word, actual position."""

COUNT_BITS, MAGNET_LOST, PARITY_ERROR = 0x0FFF, 0x8000, 0x4000
"""Of the encoder word: the AS5045's 12-bit count, its magnet flags, and an SSI frame of wrong parity."""

_RPDO = np.dtype([("controlword", "<u2"), ("target", "<i4")])
_TPDO = np.dtype([("statusword", "<u2"), ("encoder", "<u2"), ("position", "<i4")])
RPDO_BYTES, TPDO_BYTES = _RPDO.itemsize, _TPDO.itemsize


def pack_targets(controlword: NDArray[np.uint16], target: NDArray[np.int32]) -> list[bytes]:
    """Data of one RPDO a drive from controlwords (J,) and target positions (J,), increments."""
    out = np.empty(len(controlword), _RPDO)
    out["controlword"] = controlword
    out["target"] = target
    block = out.tobytes()
    return [block[i : i + RPDO_BYTES] for i in range(0, len(block), RPDO_BYTES)]


class Answers:
    """The TPDOs of one SYNC as they come in, and as arrays once they are read."""

    def __init__(self, count: int) -> None:
        self._block = bytearray(TPDO_BYTES * count)
        self._table = np.frombuffer(self._block, _TPDO)
        self._fresh = bytearray(count)
        self._missing = count

    def take(self, drive: int, data: bytes) -> bool:
        """One drive's TPDO. False where it is not of the right length."""
        if len(data) != TPDO_BYTES:
            return False
        self._block[TPDO_BYTES * drive : TPDO_BYTES * (drive + 1)] = data
        if not self._fresh[drive]:
            self._fresh[drive] = 1
            self._missing -= 1
        return True

    @property
    def complete(self) -> bool:
        """Whether every drive has answered this SYNC."""
        return self._missing == 0

    def begin(self) -> None:
        """A new SYNC: nobody has answered it yet. Values stay until they are overwritten."""
        self._fresh[:] = bytes(len(self._fresh))
        self._missing = len(self._fresh)

    @property
    def fresh(self) -> Mask:
        """(J,) who has answered."""
        return np.frombuffer(bytes(self._fresh), np.bool_)

    @property
    def statusword(self) -> NDArray[np.uint16]:
        """(J,), a copy, as the next two."""
        return self._table["statusword"].copy()

    @property
    def encoder(self) -> NDArray[np.uint16]:
        """(J,) encoder words."""
        return self._table["encoder"].copy()

    @property
    def position(self) -> NDArray[np.int32]:
        """(J,) actual positions, increments."""
        return self._table["position"].copy()
