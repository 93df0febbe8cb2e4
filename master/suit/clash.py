"""Two nodes with one id, two suits on one bus, two masters on one bus: which answers are doubted. Pure.

A CAN controller may repeat a frame, and udp_multicast may too; then both are the same. Two *different* sound
answers to one tick come from two nodes. A SYNC that this master did not send comes from another master.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from common.wire.messages import Mask
from master.suit.doubt import NodeDoubt, Weight

NOTICED = 3
"""Windows with two different answers, or SYNCs of another master, within `WITHIN` ticks."""
WITHIN = 50
"""Ticks: 0.25 s at 200 Hz."""
TWICE_IN_A_ROW = 60
"""Windows in a row (0.3 s) that each answered twice, though with the same content."""
CLEAR = 400
"""Ticks (2 s) without either after which the nodes are believed again."""


class Clashes:
    """State of N nodes."""

    def __init__(self, buses: NDArray[np.intp]) -> None:
        """`buses` (N,): the number of the bus on which each node hangs."""
        count = len(buses)
        self._buses = buses
        self._doubles = np.zeros(count, np.int64)
        self._in_a_row = np.zeros(count, np.int64)
        self._foreign = np.zeros(count, np.int64)
        self._until = np.zeros((2, count), np.int64)
        self._window = 0
        self._idle = True
        self.doubted: Mask = np.zeros(count, np.bool_)
        """(N,)"""

    def close(self, differing: Mask | None, twice: Mask | None, foreign: NDArray[np.int64] | None) -> None:
        """End a window: nodes (N,) with two different answers, with two at all, other masters' SYNCs a bus.

        All None: an ordinary window, in which each answered once.
        """
        self._window += 1
        if differing is None and foreign is None and self._idle:
            return
        self._idle = False
        if self._window % WITHIN == 0:
            self._doubles //= 2
            self._foreign //= 2
        if differing is not None and twice is not None:
            self._doubles += differing
            self._in_a_row = (self._in_a_row + 1) * twice
        else:
            self._in_a_row[:] = 0
        if foreign is not None:
            self._foreign += foreign[self._buses]
        evidence = np.array(
            [(self._doubles >= NOTICED) | (self._in_a_row >= TWICE_IN_A_ROW), self._foreign >= NOTICED]
        )
        self._until[evidence] = self._window + CLEAR
        self._doubles[evidence[0]] = self._foreign[evidence[1]] = 0
        self.doubted = np.logical_or.reduce(self._until > self._window, axis=0)
        self._idle = not (
            self.doubted.any() or self._doubles.any() or self._foreign.any() or twice is not None
        )

    def doubts(self) -> dict[int, NodeDoubt]:
        """What is wrong with which node, by its index."""
        if not self.doubted.any():
            return {}
        double, foreign = self._until > self._window
        out = {}
        for node in np.flatnonzero(self.doubted):
            words = [_DOUBLE] * bool(double[node]) + [_FOREIGN] * bool(foreign[node])
            out[int(node)] = NodeDoubt("; ".join(words), Weight.REFUSED)
        return out


_DOUBLE = "two nodes answer with its id: a second suit on this bus, or one number given twice"
_FOREIGN = "another master sends SYNC on its bus: stop one of the two"
