"""Somebody taps twice on a node: two short blows on a segment that is otherwise still. Pure.

A blow takes the specific force from gravity's by `blow_m_s2` or more, and begins and ends calmly: the node is
still before it and soon after it. So neither walking (the leg swings before the heel strikes), nor clapping
(the hand flies before it meets the other), nor any motion of the arms makes a blow. Two blows make a
double tap if nothing like a blow is near them: a row of blows is a hammer or a road, not a person's sign.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

import numpy as np

from common.clock import to_ns
from common.quaternion import Array

_GRAVITY_M_S2 = 9.81


@dataclass(frozen=True, slots=True)
class TapLimits:
    """What a tap is, and what two taps are."""

    blow_m_s2: float = 20.0
    """How far at least a tap takes the specific force from gravity's; arms reach that in blows only."""
    calm_m_s2: float = 4.0
    """A still segment stays below; a sensor that rings on its strap goes below soon."""
    calm_rad_s: float = 2.0
    """A still segment turns more slowly."""
    before_s: float = 0.1
    """For so long the segment was still before a tap."""
    onset_s: float = 0.02
    """The beginning of the blow itself, which is no motion before it."""
    ends_s: float = 0.18
    """After so long from its beginning a tap has rung out."""
    between_s: tuple[float, float] = (0.2, 0.6)
    """From the first tap to the second."""
    alone_s: float = 0.8
    """So long before the first tap and after the second there is no other."""


class DoubleTap:
    """Watches one node."""

    def __init__(self, limits: TapLimits | None = None) -> None:
        self._limits = limits or TapLimits()
        self._lively: deque[int] = deque()
        """Times within the last moments at which the segment was not calm."""
        self._blow_ns: int | None = None
        """When the blow under way began."""
        self._taps: list[int] = []
        self._spoilt_ns = -(1 << 62)
        """When there was last a blow that was no tap, or a tap too many."""

    def take(self, acc_m_s2: Array, gyr_rad_s: Array, now_ns: int) -> bool:
        """One reading (3,) each, sampled at `now_ns`; True once when a double tap is complete."""
        limits = self._limits
        force = abs(math.sqrt(float(acc_m_s2 @ acc_m_s2)) - _GRAVITY_M_S2)
        lively = force >= limits.calm_m_s2 or math.sqrt(float(gyr_rad_s @ gyr_rad_s)) >= limits.calm_rad_s
        if self._blow_ns is None and force >= limits.blow_m_s2:
            self._begin(now_ns)
        elif self._blow_ns is not None and now_ns - self._blow_ns > to_ns(limits.ends_s):
            self._end(now_ns, lively)
        if lively:
            self._lively.append(now_ns)
        while self._lively and now_ns - self._lively[0] > to_ns(limits.before_s + limits.onset_s):
            self._lively.popleft()
        return self._complete(now_ns)

    def _begin(self, now_ns: int) -> None:
        onset_ns = to_ns(self._limits.onset_s)
        if any(now_ns - at_ns > onset_ns for at_ns in self._lively):
            self._spoil(now_ns)
        else:
            self._blow_ns = now_ns

    def _end(self, now_ns: int, lively: bool) -> None:
        began_ns, self._blow_ns = self._blow_ns, None
        assert began_ns is not None
        if lively:
            self._spoil(now_ns)
            return
        # what rang was the blow's own, and no motion before the next
        self._lively.clear()
        self._taps.append(began_ns)
        shortest_s, longest_s = self._limits.between_s
        if len(self._taps) == 2 and began_ns - self._taps[0] > to_ns(longest_s):
            del self._taps[0]
        if len(self._taps) > 2 or (len(self._taps) == 2 and began_ns - self._taps[0] < to_ns(shortest_s)):
            self._spoil(now_ns)

    def _spoil(self, now_ns: int) -> None:
        self._taps.clear()
        self._spoilt_ns = now_ns

    def _complete(self, now_ns: int) -> bool:
        alone_ns = to_ns(self._limits.alone_s)
        if len(self._taps) < 2 or self._blow_ns is not None or now_ns - self._taps[1] < alone_ns:
            return False
        alone = self._taps[0] - self._spoilt_ns >= alone_ns
        self._taps.clear()
        return alone


def double_taps(acc_m_s2: Array, gyr_rad_s: Array, rate_hz: float, limits: TapLimits | None = None) -> Array:
    """Times, s, at which the readings (T, 3) of a recording complete a double tap."""
    watch = DoubleTap(limits)
    period_ns = round(1e9 / rate_hz)
    rows = zip(acc_m_s2, gyr_rad_s, strict=True)
    return np.array([i / rate_hz for i, (acc, gyr) in enumerate(rows) if watch.take(acc, gyr, i * period_ns)])
