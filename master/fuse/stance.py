"""How the sensors sit on their segments, from standing still in the zero pose: a stopgap.

It assumes that every segment then stands as in the skeleton's zero pose and that the operator faces a known
heading. A six-axis node's own heading is arbitrary, so for a sensor worn askew the axes found here may be
turned about the vertical; only a mounting calibration from motion resolves that.
"""

from __future__ import annotations

import numpy as np

from common.messages import Mask
from common.quaternion import Array, conjugate, heading_turn, multiply, normalise


class Stance:
    """Takes each node's mean orientation over its first `ticks` settled ticks as that of the zero pose."""

    def __init__(self, q_sensor_from_segment: Array, ticks: int, heading_rad: float) -> None:
        """`q_sensor_from_segment` (N, 4) stands until the stance is complete, for good if `ticks` is 0."""
        count = len(q_sensor_from_segment)
        self._ticks = ticks
        self._facing = heading_turn(heading_rad)
        self._sum = np.zeros((count, 4))
        self._taken = np.zeros(count, dtype=np.int64)
        self.q_sensor_from_segment = q_sensor_from_segment.copy()
        """(N, 4)."""

    @property
    def known(self) -> Mask:
        """(N,) nodes whose stance is complete."""
        return self._taken >= self._ticks

    def add(self, q_world_from_sensor: Array, settled: Mask) -> None:
        """One tick: orientations (N, 4), and which of them count. A node that drops out begins again."""
        open_ = ~self.known
        self._sum[open_ & ~settled] = 0.0
        self._taken[open_ & ~settled] = 0
        taking = open_ & settled
        # q and -q are one rotation: sum them on one side
        side = np.where(np.sum(self._sum * q_world_from_sensor, axis=-1) < 0.0, -1.0, 1.0)
        self._sum[taking] += (side[:, None] * q_world_from_sensor)[taking]
        self._taken[taking] += 1
        done = taking & self.known
        if done.any():
            mean = normalise(self._sum[done])
            self.q_sensor_from_segment[done] = multiply(conjugate(mean), self._facing)

    def snapshot(self) -> object:
        """The state, to be given to `restore`."""
        return self._sum.copy(), self._taken.copy(), self.q_sensor_from_segment.copy()

    def restore(self, snapshot: object) -> None:
        """Go on from a snapshot."""
        if not isinstance(snapshot, tuple):
            raise TypeError("not a snapshot of this stance")
        self._sum, self._taken, self.q_sensor_from_segment = (part.copy() for part in snapshot)
