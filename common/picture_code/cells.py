"""What a code says: 32 bits of time in steps of 0.1 ms, and 16 bits of CRC, as 6 rows of 8 cells. Pure.

Around the cells is a black frame, one cell wide, and around that a white margin, one cell wide. The CRC
refuses what was read wrongly, among it a blend of two codes (a camera exposes while its screen changes).
"""

from __future__ import annotations

import binascii

import numpy as np
from numpy.typing import NDArray

ROWS, COLUMNS = 6, 8
FRAME = 1
"""Cells of the black frame on each side."""
MARGIN = 1
"""Cells of white outside of the frame on each side."""
CODE_STEP_NS = 100_000
"""One count. 32 bits of it last for 119 h, then they begin anew."""
_COUNTS = 1 << 32

Cells = NDArray[np.bool_]
"""(ROWS, COLUMNS), True: white."""


def count_of(time_ns: int) -> int:
    """The count of a time, rounded down to the step."""
    return time_ns // CODE_STEP_NS % _COUNTS


def resolve_ns(count: int, near_ns: int) -> int:
    """The time with this count that is nearest to `near_ns`: right within 59 h."""
    near = near_ns // CODE_STEP_NS
    ahead = (count - near + _COUNTS // 2) % _COUNTS - _COUNTS // 2
    return (near + ahead) * CODE_STEP_NS


def cells_of(count: int) -> Cells:
    """The cells that say this count."""
    body = count.to_bytes(4, "big")
    bits = np.unpackbits(np.frombuffer(body + _crc(body), np.uint8))
    return bits.reshape(ROWS, COLUMNS).astype(np.bool_)


def count_in(cells: Cells) -> int | None:
    """The count that the cells say; None where the CRC does not agree."""
    data = np.packbits(cells.ravel()).tobytes()
    body, crc = data[:4], data[4:]
    return int.from_bytes(body, "big") if crc == _crc(body) else None


def _crc(body: bytes) -> bytes:
    """CRC-16 with the polynomial 0x1021, begun with ones."""
    return binascii.crc_hqx(body, 0xFFFF).to_bytes(2, "big")
