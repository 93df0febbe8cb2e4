"""Which nodes are there: fresh, late, lost, back; and which of them a window should wait for."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from common.wire.messages import Mask


class NodePresence:
    """Misses in a row of N nodes, counted in windows.

    A node is *late* when it misses a window and *lost* when it has missed `lost_after` of them in a row, or
    has never answered. Nobody waits for a lost node. But a window that does not wait may close just before
    the node's answer, for ever; so a lost node that was heard at all is awaited in the next window, and if it
    misses that too it is left alone for `lost_after` windows. A node that is always too late thus cannot
    hold up the others.
    """

    def __init__(self, count: int, lost_after: int) -> None:
        if lost_after < 1:
            raise ValueError(f"lost_after must be at least 1, not {lost_after}")
        self._lost_after = lost_after
        self._missed = np.full(count, lost_after, dtype=np.int64)
        self._rests_until = np.zeros(count, dtype=np.int64)
        self._window = 0
        self._steady = False
        """Every node answered the last window: while it stays so there is nothing to update."""
        self.lost: Mask = np.ones(count, dtype=np.bool_)
        """(N,) of the window that closed last."""
        self.awaited: Mask = np.ones(count, dtype=np.bool_)
        """(N,) of the window to come."""
        self.times_lost: NDArray[np.int64] = np.zeros(count, dtype=np.int64)
        """(N,) how often each node went from there to lost."""

    def close(self, fresh: Mask, heard: Mask) -> None:
        """End a window: which nodes answered it, and which sent a sound frame of any tick."""
        self._window += 1
        if self._steady and fresh.all():
            return
        self._missed = np.where(fresh, 0, self._missed + 1)
        self._set_lost(self._missed >= self._lost_after)
        self._steady = bool(fresh.all())
        if not self.lost.any():
            self.awaited = ~self.lost
            return
        in_vain = self.lost & self.awaited
        self._rests_until[in_vain] = self._window + self._lost_after
        awaited = ~self.lost | (heard & (self._window >= self._rests_until))
        if (awaited != self.awaited).any():
            self.awaited = awaited

    def lose(self, nodes: Mask) -> None:
        """Take nodes (N,) as lost at once, as their bus has failed."""
        self._steady = False
        self._missed[nodes] = np.maximum(self._missed[nodes], self._lost_after)
        self._set_lost(self.lost | nodes)
        self.awaited = self.awaited & ~nodes

    def _set_lost(self, lost: Mask) -> None:
        self.times_lost += lost & ~self.lost
        self.lost = lost
