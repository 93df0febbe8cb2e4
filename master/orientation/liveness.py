"""Which nodes' orientations can be trusted: alive, and long enough so that the filter has settled."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from common.wire.messages import Mask


@dataclass(frozen=True, slots=True)
class Changes:
    """What one tick changed, masks (N,)."""

    came: Mask
    """First answer ever, or after a loss."""
    went: Mask
    """Lost now."""
    settled: Mask
    """Alive for the settling time now."""


class Liveness:
    """Counts each node's ticks since it came. A late node stays alive until it is lost."""

    def __init__(self, count: int, settle_ticks: int) -> None:
        self._settle_ticks = settle_ticks
        self.alive: Mask = np.zeros(count, dtype=np.bool_)
        self.settled: Mask = np.zeros(count, dtype=np.bool_)
        self._age = np.zeros(count, dtype=np.int64)
        nothing = np.zeros(count, dtype=np.bool_)
        self.unchanged = Changes(nothing, nothing, nothing)
        """What `update` returns while every node is there and has settled, and none is lost."""
        self._steady = False

    def update(self, fresh: Mask, lost: Mask) -> Changes:
        """One tick's answers, masks (N,); `lost` wins over `fresh`."""
        if self._steady and not lost.any():
            return self.unchanged  # the usual tick, at a fifth of the cost
        was_alive, was_settled = self.alive, self.settled
        self.alive = (was_alive | fresh) & ~lost
        self._age += 1
        self._age *= self.alive
        self.settled = self._age > self._settle_ticks
        self._steady = bool(self.settled.all())
        return Changes(
            came=self.alive & ~was_alive,
            went=was_alive & ~self.alive,
            settled=self.settled & ~was_settled,
        )
