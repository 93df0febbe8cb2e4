"""A histogram with three significant digits, laid out and read as HdrHistogram does. Pure.

Gil Tene's layout: values below 2048 have a slot each, and above that each doubling has 1024 slots. All slots
are there from the start, so recording never allocates. (The package hdrhistogram has no wheels for aarch64.)
"""

from __future__ import annotations

from array import array

import numpy as np

_HALF_BITS = 10
_EXACT_BITS = _HALF_BITS + 1
"""Values of so many bits are kept exactly."""


class Histogram:
    """Counts of whole values from 0 to `highest`."""

    def __init__(self, highest: int) -> None:
        self._highest = highest
        self._counts = array("q", [0]) * (self._slot(highest) + 1)
        self.count = 0

    def record(self, value: int, count: int = 1) -> None:
        """Take a value so many times. Raises ValueError for one beyond the range."""
        if not 0 <= value <= self._highest:
            raise ValueError(f"{value}: expected 0 to {self._highest}")
        self._counts[self._slot(value)] += count
        self.count += count

    def at_percentile(self, percentile: float) -> int:
        """The largest value of the slot in which that percentile lies; 0 where nothing was recorded."""
        return self.at_percentiles(percentile)[0]

    def at_percentiles(self, *percentiles: float) -> list[int]:
        """As `at_percentile` for each: they share the one pass over all slots, which is what costs."""
        if not self.count:
            return [0] * len(percentiles)
        wanted = [max(1, int(each / 100.0 * self.count + 0.5)) for each in percentiles]
        below = np.cumsum(np.frombuffer(self._counts, dtype=np.int64))
        return [self._largest(int(slot)) for slot in np.searchsorted(below, wanted)]

    @staticmethod
    def _slot(value: int) -> int:
        shift = max(0, value.bit_length() - _EXACT_BITS)
        return (shift << _HALF_BITS) + (value >> shift)

    @staticmethod
    def _largest(slot: int) -> int:
        shift = max(0, (slot >> _HALF_BITS) - 1)
        return ((slot - (shift << _HALF_BITS) + 1) << shift) - 1
