"""CRC-8 SAE J1850, for one frame and for all frames of a tick at once.

Polynomial x⁸ + x⁴ + x³ + x² + 1 (0x1D), start 0xFF, final XOR 0xFF, no reflection; of "123456789" it is
0x4B. It covers the frame's 11-bit identifier (two bytes, low first) and then the data before the CRC.

The batch check rests on the CRC being affine over GF(2): crc(a ⊕ b) = crc(a) ⊕ crc(b) ⊕ crc(0) for
messages of one length. So each byte of a frame adds its own share, whatever the others are:

    crc(id, d₀ … dₙ₋₁) = crc(id, 0 … 0) ⊕ share₀[d₀] ⊕ … ⊕ shareₙ₋₁[dₙ₋₁]

One table look-up and one XOR over the rows replace the walk along each frame.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

POLYNOMIAL = 0x1D
START = 0xFF
FINAL_XOR = 0xFF

Bytes = NDArray[np.uint8]


def _step_table() -> bytes:
    table = bytearray()
    for register in range(256):
        for _ in range(8):
            register = (register << 1) ^ (POLYNOMIAL if register & 0x80 else 0)
            register &= 0xFF
        table.append(register)
    return bytes(table)


_STEP = _step_table()


def crc8(message: bytes, start: int = START) -> int:
    """CRC of a message; `start` is the register before its first byte."""
    register = start
    for byte in message:
        register = _STEP[register ^ byte]
    return register ^ FINAL_XOR


def frame_crc(frame_id: int, covered: bytes) -> int:
    """CRC that a frame carries in its last byte; `covered` is its data before that byte."""
    return crc8(frame_id.to_bytes(2, "little") + covered)


class BatchCrc:
    """Checks frames of one length, whose last byte is their CRC."""

    def __init__(self, length: int) -> None:
        """`length` in bytes, the CRC included."""
        self.length = length
        shares = np.zeros((length, 256), dtype=np.uint8)
        # the CRC byte itself stands for its own value, so that an intact frame XORs to crc(id, 0 … 0)
        shares[-1] = np.arange(256)
        share = shares[-1]
        for place in range(length - 2, -1, -1):
            share = np.frombuffer(_STEP, dtype=np.uint8)[share]
            shares[place] = share
        self._shares = shares.reshape(-1)
        self._rows = np.arange(0, 256 * length, 256)

    def blank(self, frame_id: int) -> int:
        """What `folded` gives for every intact frame of that identifier: crc(id, 0 … 0)."""
        return frame_crc(frame_id, bytes(self.length - 1))

    def folded(self, frames: Bytes) -> Bytes:
        """XOR of all shares, (F,), of frames (F, length); equal to `blank` of its id where intact."""
        shares: Bytes = self._shares.take(frames + self._rows)
        folded: Bytes = np.bitwise_xor.reduce(shares, axis=1)
        return folded
