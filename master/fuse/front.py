"""What every filter does with a tick's readings before it believes them."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from common.messages import Mask
from common.quaternion import Array
from master.doubt import NodeDoubt, Weight
from master.fuse.gross_bias import GrossBias
from master.fuse.soundness import Soundness

_MANY = 0.25
"""Share of unsound readings from which on a node's joints are invalid."""
_FORGET = 0.8
"""Of the share of unsound readings, from one look to the next."""
_TOLD_RAD_S = math.radians(2.0)
"""A bias larger than this is one that calibration should have taken off."""


class Front:
    """Leaves out what is no reading, and takes off a gross bias found at rest, for n nodes."""

    def __init__(self, limit_deg_s: float, reach_rad_s: float, rate_hz: float, count: int) -> None:
        """`limit_deg_s` of the bias that is learnt; `reach_rad_s` of what the filter learns by itself."""
        self._period_s = 1.0 / rate_hz
        self._sound = Soundness(count)
        self._gross = GrossBias(math.radians(limit_deg_s), reach_rad_s, count)
        self._ticks, self._seen = 0, np.zeros(count, dtype=np.int64)
        self._unsound = np.zeros(count)
        self.corrected: Mask | None = None
        """(n,) whose bias was found with the readings taken last; None for nobody's. They lie still: gravity
        and field give their orientation, and what the filter made of the bias is to be forgotten."""

    @property
    def magnetic(self) -> Mask:
        """(n,) who has a field in what was taken last."""
        return self._sound.magnetic

    @property
    def skipped(self) -> NDArray[np.int64]:
        """(n,) ticks with a reading that was none."""
        return self._sound.skipped

    def take(
        self, gyr_rad_s: Array, acc_m_s2: Array, mag_ut: Array, dt_s: float | None
    ) -> tuple[Array, Array, Array]:
        """One tick's readings (n, 3) each, raw, to those that the filter may use.

        An acceleration that is left out is a row of zeros, a field a row of NaN.
        """
        gyr, acc, mag = self._sound.take(gyr_rad_s, acc_m_s2, mag_ut)
        gross = self._gross
        self.corrected = None
        self._ticks += 1
        if gross.due(self._period_s if dt_s is None else dt_s):
            self.corrected = gross.look(gyr, acc, mag)
            self._count()
        return (gyr - gross.offset_rad_s if gross.some else gyr), acc, mag

    def _count(self) -> None:
        """Follow the share of ticks without a sound reading, (n,)."""
        skipped = self._sound.skipped
        if skipped.any():
            now = (skipped - self._seen) / self._ticks
            self._unsound = np.maximum(now, _FORGET * self._unsound)
            self._unsound[self._unsound < 1e-3] = 0.0
            self._seen = skipped.copy()
        self._ticks = 0

    @property
    def spoilt(self) -> Mask | None:
        """(n,) who had a reading that was none in what was taken last; None for nobody."""
        return self._sound.spoilt

    def with_offset(self, bias_rad_s: Array) -> Array:
        """The whole bias (n, 3): what the filter says it is, and what was taken off before it."""
        return bias_rad_s + self._gross.offset_rad_s if self._gross.some else bias_rad_s

    def doubts(self) -> dict[int, NodeDoubt]:
        """Nodes whose gyros want a calibration, by number."""
        out = {}
        gross = self._gross
        if gross.some:
            off = np.abs(gross.offset_rad_s).max(axis=1)
            for node in np.flatnonzero(off > _TOLD_RAD_S).tolist():
                rate = math.degrees(off[node])
                words = f"its gyro reads {rate:.1f}°/s at rest, which is taken off; calibrate it"
                out[node] = NodeDoubt(words, Weight.TOLD)
        if gross.beyond_rad_s.any():
            for node in np.flatnonzero(gross.beyond_rad_s).tolist():
                rate = math.degrees(gross.beyond_rad_s[node])
                words = (
                    f"uncalibrated: its gyro reads {rate:.1f}°/s at rest, more than rest_bias_limit_deg_s; "
                    "calibrate it (tandem calibrate imu) or replace it"
                )
                out[node] = NodeDoubt(words, Weight.INVALID)
        for node in np.flatnonzero(self._unsound).tolist():
            words = f"{self._sound.skipped[node]} readings were no numbers, or beyond any sensor's range"
            weight = Weight.INVALID if self._unsound[node] > _MANY else Weight.TOLD
            out[node] = NodeDoubt(words, weight)
        return out

    def restart(self, nodes: Mask) -> None:
        """Forget the past of some nodes, mask (n,), but not their gyros' offsets."""
        self._sound.restart(nodes)
        self._gross.restart(nodes)

    def snapshot(self) -> object:
        """The state, to be given to `restore`."""
        return self._sound.snapshot(), self._gross.snapshot()

    def restore(self, snapshot: object) -> None:
        """Go on from a snapshot."""
        if not isinstance(snapshot, tuple):
            raise TypeError("not a snapshot of this front")
        sound, gross = snapshot
        self._sound.restore(sound)
        self._gross.restore(gross)
        self._ticks, self._seen = 0, self._sound.skipped.copy()
