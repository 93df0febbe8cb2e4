"""What the robot cannot follow: counted segment by segment, and told to the operator without flooding."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from common.clock import to_ns
from common.metrics.master import Unreached
from common.quaternion import Array

COUNTED_RAD = math.radians(5.0)
"""A segment farther from the operator's than this counts as beyond reach: the two never fit exactly."""
_REPORTED_RAD = math.radians(15.0)
_LASTING_NS = to_ns(0.5)
"""What passes sooner is not worth a word."""
_QUIET_NS = to_ns(10.0)
"""A segment is told of once in this time at most."""


class BeyondReach:
    """Counters of all segments, and when each was last told of."""

    def __init__(self, segment_names: Sequence[str]) -> None:
        self._names = tuple(segment_names)
        count = len(self._names)
        self._times: NDArray[np.int64] = np.zeros(count, np.int64)
        self._computed = 0
        self._now_rad: Array = np.zeros(count)
        self._most_rad: Array = np.zeros(count)
        self._since_ns: dict[int, int] = {}
        self._reported_ns: dict[int, int] = {}

    def note(self, now_ns: int, short_rad: Array) -> list[str]:
        """Take what each segment (N,) lacks of its posture; returns what to tell the operator."""
        self._computed += 1
        self._now_rad = short = np.where(np.isnan(short_rad), 0.0, short_rad)
        beyond = short > COUNTED_RAD
        if not beyond.any() and not self._since_ns:
            return []
        self._times += beyond
        np.maximum(self._most_rad, short, out=self._most_rad)
        self._since_ns = {i: self._since_ns.get(i, now_ns) for i in np.flatnonzero(beyond).tolist()}
        messages = []
        for i, since_ns in self._since_ns.items():
            quiet = i in self._reported_ns and now_ns - self._reported_ns[i] < _QUIET_NS
            if short[i] > _REPORTED_RAD and now_ns - since_ns >= _LASTING_NS and not quiet:
                self._reported_ns[i] = now_ns
                messages.append(
                    f"{self._names[i]}: the operator is {math.degrees(short[i]):.0f}° beyond what the robot "
                    "can reach; it stands at its nearest posture"
                )
        return messages

    @property
    def far(self) -> bool:
        """Whether a segment is so far beyond reach now that it is worth a word."""
        return bool((self._now_rad > _REPORTED_RAD).any())

    def metrics(self) -> dict[str, Unreached]:
        """The segments that were beyond reach."""
        return {
            self._names[i]: Unreached(
                percent=round(100.0 * int(self._times[i]) / self._computed, 2),
                now_deg=round(math.degrees(self._now_rad[i]), 1),
                most_deg=round(math.degrees(self._most_rad[i]), 1),
            )
            for i in np.flatnonzero(self._times).tolist()
        }
