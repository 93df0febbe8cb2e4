"""Readings that no sensor can give (NaN, infinite, absurd) never reach a filter's state."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from common.quaternion import Array
from common.wire.messages import Mask

GYR_LIMIT_RAD_S = 90.0
ACC_LIMIT_M_S2 = 2e3
MAG_LIMIT = 1e7
"""Beyond what is sold for people (4,000 °/s, 200 g); of the field in any unit, nT too."""
_GYR_SQUARE, _ACC_SQUARE, _MAG_SQUARE = GYR_LIMIT_RAD_S**2, ACC_LIMIT_M_S2**2, MAG_LIMIT**2


class Soundness:
    """Replaces what is no reading, for n nodes, and counts it.

    A rate is replaced by the last sound one, an acceleration by zero, which every filter leaves out, a field
    by NaN: no magnetometer this time. A field that is NaN throughout is none, and not counted.
    """

    def __init__(self, count: int) -> None:
        self.skipped: NDArray[np.int64] = np.zeros(count, dtype=np.int64)
        """(n,) ticks with a reading that was none."""
        self.everybody: Mask = np.ones(count, dtype=np.bool_)
        self._none: Mask = np.zeros(count, dtype=np.bool_)
        self.magnetic = self.everybody
        """(n,) nodes with a magnetic field in what `take` returned last."""
        self.spoilt: Mask | None = None
        """(n,) nodes with an unusable reading in what `take` was given last; None where no node had one."""
        self._gyr = np.zeros((count, 3))

    def take(self, gyr: Array, acc: Array, mag: Array) -> tuple[Array, Array, Array]:
        """One tick's readings (n, 3) each; what comes back is the same arrays where all is sound."""
        self.spoilt = None
        # a sum of squares below the limit's: no single value can lie beyond it, nor be NaN
        squares = _square(gyr), _square(acc), _square(mag)
        if squares[0] < _GYR_SQUARE and squares[1] < _ACC_SQUARE:
            if squares[2] < _MAG_SQUARE:
                self.magnetic = self.everybody
                self._gyr[:] = gyr
                return gyr, acc, mag
            if np.isnan(mag).all():
                self.magnetic = self._none
                self._gyr[:] = gyr
                return gyr, acc, mag
        return self._take_each(gyr, acc, mag)

    def _take_each(self, gyr: Array, acc: Array, mag: Array) -> tuple[Array, Array, Array]:
        """The same, node by node."""
        bad_gyr, bad_acc, bad_mag = (
            _beyond(gyr, GYR_LIMIT_RAD_S),
            _beyond(acc, ACC_LIMIT_M_S2),
            _beyond(mag, MAG_LIMIT),
        )
        spoilt = bad_gyr | bad_acc
        if bad_mag.any():
            spoilt |= bad_mag & ~np.isnan(mag).all(axis=1)
            mag = np.where(bad_mag[:, None], np.nan, mag)
        if spoilt.any():
            self.skipped += spoilt
            self.spoilt = spoilt
            gyr = np.where(bad_gyr[:, None], self._gyr, gyr)
            acc = np.where(bad_acc[:, None], 0.0, acc)
        self.magnetic = np.logical_not(bad_mag)
        self._gyr[:] = gyr
        return gyr, acc, mag

    def restart(self, nodes: Mask) -> None:
        """Forget the last rates of some nodes, mask (n,)."""
        self._gyr[nodes] = 0.0


def _beyond(part: Array, limit: float) -> Mask:
    out: Mask = np.logical_not((np.abs(part) <= limit).all(axis=1))
    return out


def _square(part: Array) -> np.floating:
    flat = part.ravel()
    # unlike dot it minds no overflow, and to silence that would cost more than all else here
    out: np.floating = np.vdot(flat, flat)
    return out
