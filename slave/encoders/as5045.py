"""What an AS5045 encoder sends: a count of 12 bits, what the chip thinks of its magnet, and parity.

18 bits over SSI, the highest first: D11…D0, OCF, COF, LIN, MagINC, MagDEC, even parity (AS5045 datasheet,
serial interface). Drives that read their encoder by themselves pass on no more than the count; where the word
itself arrives, this says whether to believe it, and why not.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntFlag

import numpy as np
from numpy.typing import NDArray

from common.wire.messages import Mask

Words = NDArray[np.uint32]
BITS = 18
COUNT_SHIFT = 6


class Flag(IntFlag):
    """The six bits below the count."""

    OCF = 1 << 5
    """Offset compensation finished: the chip is awake."""
    COF = 1 << 4
    """CORDIC overflow: the angle could not be computed."""
    LIN = 1 << 3
    """Linearity alarm: the field is so weak, strong or askew that the angle may be wrong."""
    MAG_INC = 1 << 2
    """The magnet comes nearer; with MAG_DEC: the field is out of its range."""
    MAG_DEC = 1 << 1
    """The magnet goes away."""
    PARITY = 1 << 0
    """Makes the number of ones even."""


OUT_OF_RANGE = Flag.MAG_INC | Flag.MAG_DEC
"""Both at once: the chip's yellow range. The angle is less exact, and the magnet is on its way out."""


@dataclass(frozen=True, slots=True)
class Decoded:
    """J encoders' words."""

    counts: NDArray[np.int64]
    """(J,) 0..4095, as in `EncoderReading`."""
    valid: Mask
    """(J,) whether the count may be believed."""
    flags: NDArray[np.uint8]
    """(J,) the six bits, see `Flag`."""


def decode(words: Words) -> Decoded:
    """Take apart the words (J,) of J encoders.

    Believed where parity is even, nothing is above 18 bits, OCF is set, COF and LIN are not. No answer at all
    shows as all zeros or all ones: neither is believed (OCF, COF).
    """
    flags = (words & np.uint32(0x3F)).astype(np.uint8)
    needed = flags & np.uint8(Flag.OCF | Flag.COF | Flag.LIN)
    valid: Mask = (needed == Flag.OCF) & ~_odd(words) & (words >> np.uint32(BITS) == 0)
    counts = (words >> np.uint32(COUNT_SHIFT) & np.uint32(0xFFF)).astype(np.int64)
    return Decoded(counts, valid, flags)


def encode(counts: NDArray[np.int64], flags: Flag = Flag.OCF) -> Words:
    """The words (J,) that encoders send at counts 0..4095, parity put right: for simulated buses."""
    words = counts.astype(np.uint32) << np.uint32(COUNT_SHIFT) | np.uint32(flags & ~Flag.PARITY)
    out: Words = words | _odd(words).astype(np.uint32)
    return out


def faults(joint_names: Sequence[str], words: Words) -> dict[str, str]:
    """Why counts are not believed, in words, by joint: for `Servos.faults`, which ends motion."""
    decoded = decode(words)
    return {
        joint_names[j]: _words(int(words[j]), Flag(int(decoded.flags[j])))
        for j in np.flatnonzero(~decoded.valid).tolist()
    }


def at_edge(words: Words) -> Mask:
    """Which magnets (J,) are about to leave their range: to be looked after, no reason to stop."""
    out: Mask = (words & np.uint32(OUT_OF_RANGE)) == OUT_OF_RANGE
    return out


def _words(word: int, flags: Flag) -> str:
    if word in (0, (1 << BITS) - 1):
        return "the encoder does not answer"
    if word >> BITS or word.bit_count() % 2:
        return "the encoder's word was spoiled on its way (parity)"
    if Flag.OCF not in flags:
        return "the encoder has not started (OCF)"
    if Flag.COF in flags:
        return "the encoder cannot compute its angle (COF)"
    return "the encoder's magnet is lost or out of place (LIN)"


def _odd(words: Words) -> Mask:
    folded = words
    for shift in (16, 8, 4, 2, 1):
        folded = folded ^ (folded >> np.uint32(shift))
    out: Mask = (folded & np.uint32(1)).astype(np.bool_)
    return out
