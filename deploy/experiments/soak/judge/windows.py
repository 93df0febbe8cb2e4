"""Spans of time in which a failure has a reason: a fault, a start, the host, the network. Pure."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from common.quaternion import Array
from common.wire.messages import Mask

AFTER_S = 2.5
"""Counters are published once a second and a sample covers the second before: a fault shows up so late."""
BEFORE_S = 0.25


@dataclass(frozen=True, slots=True)
class Window:
    """A span of the soak, in seconds, in which a failure has a reason."""

    from_s: float
    until_s: float
    why: str

    def includes(self, at_s: float) -> bool:
        """Whether a failure seen at that time may have this reason."""
        return self.from_s - BEFORE_S <= at_s <= self.until_s + AFTER_S


def explained(at_s: Array, windows: Iterable[Window]) -> Mask:
    """(N,) which of the times lie in any window."""
    mask = np.zeros(len(at_s), np.bool_)
    for window in windows:
        mask |= (at_s >= window.from_s - BEFORE_S) & (at_s <= window.until_s + AFTER_S)
    return mask


def reason(at_s: float, windows: Sequence[Window]) -> str:
    """The reason of a failure at that time; empty where it has none."""
    return next((window.why for window in windows if window.includes(at_s)), "")
