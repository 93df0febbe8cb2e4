"""Identifiers and layout of the frames that SYNC moves: an RPDO to each drive, and its TPDOs. Pure."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

NMT, SYNC, EMERGENCY, TPDO1, RPDO1, TPDO3, TPDO2 = 0x000, 0x080, 0x080, 0x180, 0x200, 0x380, 0x280
SDO_ANSWER, SDO_REQUEST, HEARTBEAT = 0x580, 0x600, 0x700
"""Function codes of CiA 301's predefined connection set; a node's id is added to all but NMT and SYNC."""
RPDO2 = 0x300
RPDOS = (RPDO1, RPDO2, 0x400, 0x500)

ENCODER = 0x2000
"""The object in which the drives of `tandem drives` show the output encoder's word."""
INPUTS = 0x60FD
"""Digital inputs, 32 bits; sent by the drives of `tell_inputs`, as TPDO 3."""
INPUTS_MAPPING = (INPUTS << 16 | 0x0020,)
INPUTS_BYTES = 4
TORQUE, CURRENT = 0x6077, 0x6078
"""What a drive tells of its effort, in thousandths of its rating, signed 16 bits: in a TPDO of its own."""
EFFORT_BYTES = 2
LIMITS = {"60E0h": (0x60E0, 0x60E1), "6072h": (0x6072,)}
"""What takes a torque limit, in thousandths of the rating, unsigned 16 bits: in RPDO 2."""

COUNT_BITS, MAGNET_LOST, PARITY_ERROR = 0x0FFF, 0x8000, 0x4000
"""Bits of the encoder word: the AS5045's 12-bit count, its magnet flags, and an SSI frame of wrong parity."""

ENCODER_FLAGS = np.uint16(MAGNET_LOST | PARITY_ERROR)

_RPDO = np.dtype([("controlword", "<u2"), ("target", "<i4")])
TPDO = np.dtype([("statusword", "<u2"), ("encoder", "<u2"), ("position", "<i4")])
RPDO_BYTES, TPDO_BYTES = _RPDO.itemsize, TPDO.itemsize


def pack_targets(controlword: NDArray[np.uint16], target: NDArray[np.int32]) -> list[bytes]:
    """Data of one RPDO a drive from controlwords (J,) and target positions (J,), increments."""
    out = np.empty(len(controlword), _RPDO)
    out["controlword"] = controlword
    out["target"] = target
    block = out.tobytes()
    return [block[i : i + RPDO_BYTES] for i in range(0, len(block), RPDO_BYTES)]


def encoder_words(flags: int) -> str:
    """What the flags of an encoder word say is wrong; empty where all is well."""
    named = ((MAGNET_LOST, "encoder: magnet lost"), (PARITY_ERROR, "encoder: parity error"))
    return "; ".join(words for bit, words in named if flags & bit)
