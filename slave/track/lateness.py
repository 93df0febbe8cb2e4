"""How late samples are: the usual figure and its spread, learnt from the samples themselves."""

from __future__ import annotations

_SPREADS = 4.0
_LOST = 2.0
"""An age of more than this many usual ones means a loss: it counts as this much."""


class Lateness:
    """Age that the newest sample reaches before the next one replaces it: a transit and a period.

    Mean and mean deviation follow each measurement m as a TCP sender's round trip time does (Jacobson and
    Karels 1988; RFC 6298, with its gains as the defaults):

        d += g_d (|m - mean| - d),   mean += g (m - mean),   late = mean + 4 d
    """

    def __init__(self, mean_gain: float = 0.125, spread_gain: float = 0.25) -> None:
        self._mean_gain, self._spread_gain = mean_gain, spread_gain
        self.mean_s: float | None = None
        """None before the second sample."""
        self.spread_s = 0.0
        """Mean deviation."""

    def reset(self) -> None:
        """Forget what was measured."""
        self.mean_s, self.spread_s = None, 0.0

    def note(self, age_s: float) -> None:
        """Take the age of the sample that is being replaced."""
        age_s = max(age_s, 0.0)
        if not self.mean_s:  # none, or one of 0, of which twice is no more: clocks that were not yet known
            self.mean_s = age_s
            return
        surprise_s = min(age_s, _LOST * self.mean_s) - self.mean_s
        self.spread_s += self._spread_gain * (abs(surprise_s) - self.spread_s)
        self.mean_s += self._mean_gain * surprise_s

    @property
    def late_s(self) -> float:
        """An age that few samples reach; 0 before there is a measurement."""
        return (self.mean_s or 0.0) + _SPREADS * self.spread_s
