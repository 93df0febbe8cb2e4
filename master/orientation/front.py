"""What every filter does first with a tick's readings."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from common.quaternion import Array
from common.wire.messages import Mask
from master.orientation.field_watch import FieldWatch
from master.orientation.filter import FilterSection
from master.orientation.gross_bias import PERIOD_S, GrossBias
from master.orientation.soundness import Soundness
from master.suit.doubt import NodeDoubt, Weight

_MANY = 0.25
"""Share of unsound readings from which on a node's joints are invalid."""
_FORGET = 0.8
"""Of the share of unsound readings, from one look to the next."""
_WITHHELD_S, _SELDOM = 60.0, 16
"""For so long a doubted field does not count at all, then in one tick of so many."""
_FIELD_LOOKS = 3
"""Of the gyros' to one of the fields, which cost the most; where the front weighs every field itself, one."""
_NOTED_RAD_S = math.radians(2.0)
"""A bias larger than this is one that calibration should have taken off."""


class FrontSection(FilterSection):
    """What the configurations of all filters share."""

    rest_bias_limit_deg_s: float = Field(default=20.0, ge=0.0, le=90.0, allow_inf_nan=False)
    """The largest bias of a gyro that is learnt at rest, degrees/s on any axis. A node whose gyro is further
    off is called uncalibrated, and its joints are invalid."""
    field_change: float = Field(default=0.1, ge=0.0, le=1.0, allow_inf_nan=False)
    """Share by which a node's field may differ in strength from what it was since its start (0.1: or by 10°
    in dip), over some seconds. Beyond it people are told, and the gyro keeps the heading. 0: no watch."""


@dataclass(frozen=True, slots=True)
class FrontLimits:
    """What a front allows."""

    bias_deg_s: float
    """The largest bias that is learnt at rest, 0 for none."""
    reach_rad_s: float
    """What the filter learns by itself."""
    field_change: float
    """See `FrontSection.field_change`."""
    any_field: bool = True
    """The filter itself weighs a field that is unusual for a moment; else the front leaves it out."""


class Front:
    """Leaves out unusable readings, changed magnetic fields and gross biases found at rest, of n nodes."""

    def __init__(
        self, limits: FrontLimits, rate_hz: float, count: int, q_inertial_from_sensor: Callable[[], Array]
    ) -> None:
        """`q_inertial_from_sensor` gives the filter's newest orientations (n, 4)."""
        self._inertial = q_inertial_from_sensor
        self._field = FieldWatch(limits.field_change, count)
        self._looks, self._field_looks = 0, _FIELD_LOOKS if limits.any_field else 1
        self._any_field = limits.any_field
        self._hidden: Mask | None = None
        self._withheld_s = np.zeros(count)
        self._period_s = 1.0 / rate_hz
        self._sound = Soundness(count)
        self._gross = GrossBias(math.radians(limits.bias_deg_s), limits.reach_rad_s, count)
        self._ticks, self._seen = 0, np.zeros(count, dtype=np.int64)
        self._unsound = np.zeros(count)
        self.magnetic: Mask = self._sound.magnetic
        """(n,) nodes with a magnetic field in what `take` returned last."""
        self.corrected: Mask | None = None
        """(n,) nodes whose bias was found with the last readings; None for no node. They lie still: gravity
        and field give their orientation, and what the filter made of the bias is to be forgotten."""

    @property
    def everybody(self) -> bool:
        """Whether every node has a field in what was taken last, as far as that is told at no cost."""
        return self.magnetic is self._sound.everybody

    @property
    def skipped(self) -> NDArray[np.int64]:
        """(n,) ticks with an unusable reading."""
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
            self._looks += 1
        if self._looks == self._field_looks:
            self._looks, field_s = 0, self._field_looks * PERIOD_S
            self._field.look(mag, self._sound.magnetic, self._inertial(), field_s)
            self._withheld_s = np.where(self._field.doubted, self._withheld_s + field_s, 0.0)
            hidden = self._field.doubted if self._any_field else self._field.doubted | self._field.unusual
            self._hidden = hidden if hidden.any() else None
        self.magnetic = self._sound.magnetic
        if self._hidden is not None:
            mag = self._without(self._hidden, mag)
        return (gyr - gross.offset_rad_s if gross.some else gyr), acc, mag

    def _without(self, hidden: Mask, mag: Array) -> Array:
        """Fields (n, 3), NaN where `hidden` (n,); after a while a few of them count, not to lose north."""
        if self._ticks % _SELDOM == 0:
            hidden = hidden & (self._withheld_s < _WITHHELD_S)
        self.magnetic = self.magnetic & ~hidden
        return np.where(hidden[:, None], np.nan, mag)

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
        """(n,) nodes with an unusable reading in what was taken last; None where no node had one."""
        return self._sound.spoilt

    def with_offset(self, bias_rad_s: Array) -> Array:
        """The whole bias (n, 3): what the filter says it is, and what was taken off before it."""
        return bias_rad_s + self._gross.offset_rad_s if self._gross.some else bias_rad_s

    def undecided(self) -> Mask:
        """(n,) nodes whose rate may be a bias not learnt yet."""
        return self._gross.undecided()

    def doubts(self) -> dict[int, NodeDoubt]:
        """Nodes whose gyros want a calibration, by number."""
        out = {}
        gross = self._gross
        if self._field.doubted.any():
            for node in np.flatnonzero(self._field.doubted).tolist():
                out[node] = NodeDoubt(self._field.words(node), Weight.NOTED)
        if gross.some:
            off = np.abs(gross.offset_rad_s).max(axis=1)
            for node in np.flatnonzero(off > _NOTED_RAD_S).tolist():
                rate = math.degrees(off[node])
                words = f"its gyro reads {rate:.1f}°/s at rest, which is taken off; calibrate it"
                out[node] = NodeDoubt(words, Weight.NOTED)
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
            weight = Weight.INVALID if self._unsound[node] > _MANY else Weight.NOTED
            out[node] = NodeDoubt(words, weight)
        return out

    def restart(self, nodes: Mask) -> None:
        """Forget the past of some nodes, mask (n,), but not their gyros' offsets."""
        self._sound.restart(nodes)
        self._gross.restart(nodes)
        self._field.restart(nodes)
        if self._hidden is not None:
            # their first orientation needs their field
            self._hidden = self._hidden & ~nodes


class BehindFront:
    """What each filter reports of its front."""

    _front: Front

    def undecided(self) -> Mask:
        """(n,) nodes whose rate may be a bias that is not learnt yet."""
        return self._front.undecided()

    def doubts(self) -> dict[int, NodeDoubt]:
        """Nodes whose gyros need a calibration, by number."""
        return self._front.doubts()

    @property
    def spoilt(self) -> Mask | None:
        """(n,) nodes whose last update held an unusable reading; None where no node's did."""
        return self._front.spoilt

    @property
    def skipped(self) -> NDArray[np.int64]:
        """(n,) ticks with an unusable reading."""
        return self._front.skipped
