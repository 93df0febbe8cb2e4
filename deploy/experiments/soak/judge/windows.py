"""What can be put down to a fault, a start or the host: spans of time with a reason. Pure."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from common.quaternion import Array
from common.wire.messages import Mask

AFTER_S = 2.5
"""Counters are told once a second, and a sample is of the second before: so late a fault shows."""
BEFORE_S = 0.25


@dataclass(frozen=True, slots=True)
class Window:
    """A span in which what goes wrong has a reason; seconds of the soak."""

    from_s: float
    until_s: float
    why: str

    def includes(self, at_s: float) -> bool:
        """Whether something that was seen at that time may come of it."""
        return self.from_s - BEFORE_S <= at_s <= self.until_s + AFTER_S


def explained(at_s: Array, windows: Iterable[Window]) -> Mask:
    """(N,) which of the times lie in any window."""
    mask = np.zeros(len(at_s), np.bool_)
    for window in windows:
        mask |= (at_s >= window.from_s - BEFORE_S) & (at_s <= window.until_s + AFTER_S)
    return mask


def reason(at_s: float, windows: Sequence[Window]) -> str:
    """Why, or nothing."""
    return next((window.why for window in windows if window.includes(at_s)), "")
