"""The drives' answers to one SYNC: as they come in, and as arrays once they are read. Pure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from common.wire.messages import Mask
from slave.servos.canopen import pdo
from slave.servos.canopen.status_bits import GOOD


@dataclass(frozen=True, slots=True)
class DriveAnswers:
    """The answers to one SYNC, (J,) each."""

    synced_ns: int
    fresh: Mask
    """Which drives have answered."""
    statusword: NDArray[np.uint16]
    encoder_valid: Mask
    encoder_counts: NDArray[np.int64]
    encoder_flags: NDArray[np.uint16]
    """What each encoder says is wrong with it, see `pdo.encoder_words`."""
    position: NDArray[np.int32]
    """Increments."""


class SyncAnswers:
    """The TPDOs of one SYNC as they come in, and as arrays once they are read."""

    def __init__(self, count: int, unused_bits: Sequence[Sequence[int]] = ()) -> None:
        """`unused_bits`: of each drive, bits of its statusword that are taken for good whatever they are."""
        self._good = np.array([_good_bits(bits) for bits in unused_bits] or [(0, 0xFFFF)] * count, np.uint16)
        """(J, 2) which bits are set, and which kept, in each statusword."""
        self._block = bytearray(pdo.TPDO_BYTES * count)
        self._table = np.frombuffer(self._block, pdo.TPDO)
        self._fresh = bytearray(count)
        self._missing = count

    def take(self, drive: int, data: bytes) -> bool:
        """One drive's TPDO. False where it is not of the right length."""
        if len(data) != pdo.TPDO_BYTES:
            return False
        self._block[pdo.TPDO_BYTES * drive : pdo.TPDO_BYTES * (drive + 1)] = data
        if not self._fresh[drive]:
            self._fresh[drive] = 1
            self._missing -= 1
        return True

    @property
    def complete(self) -> bool:
        """Whether every drive has answered this SYNC."""
        return self._missing == 0

    def statusword(self, drive: int) -> int:
        """The newest of one drive."""
        set_, kept = self._good[drive]
        return int((self._table["statusword"][drive] | set_) & kept)

    def begin(self) -> None:
        """A new SYNC: nobody has answered it yet. Values stay until they are overwritten."""
        self._fresh[:] = bytes(len(self._fresh))
        self._missing = len(self._fresh)

    def of(self, synced_ns: int) -> DriveAnswers:
        """All answers to the SYNC of that time so far, copied."""
        fresh: Mask = np.frombuffer(bytes(self._fresh), np.bool_)
        words = self._table["encoder"].copy()
        return DriveAnswers(
            synced_ns,
            fresh,
            (self._table["statusword"] | self._good[:, 0]) & self._good[:, 1],
            fresh & (words & pdo.ENCODER_FLAGS == 0),
            (words & pdo.COUNT_BITS).astype(np.int64),
            words & pdo.ENCODER_FLAGS,
            self._table["position"].copy(),
        )


def _good_bits(bits: Sequence[int]) -> tuple[int, int]:
    mask = sum(1 << bit for bit in set(bits))
    return mask & GOOD, 0xFFFF & ~(mask & ~GOOD)
