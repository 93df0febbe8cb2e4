"""What standing still in the zero pose tells of each node: its heading, or how its sensor sits.

It assumes that every segment then stands as in the skeleton's zero pose and that the operator faces a known
heading. Of a node whose mounting is calibrated only the heading is taken; how far it leans then is a check of
the mounting, and of the pose. Of any other node the mounting itself is taken: a stopgap, because a six-axis
node's own heading is arbitrary, so that for a sensor worn askew the axes found here may be turned about the
vertical.
"""

from __future__ import annotations

import numpy as np

from common.messages import Mask
from common.quaternion import Array, angle_between, conjugate, heading_rad, heading_turn, multiply, normalise


class Stance:
    """Takes each node's mean orientation over its first `ticks` settled ticks as that of the zero pose."""

    def __init__(
        self, q_sensor_from_segment: Array, ticks: int, facing_rad: float, mounted: Mask | None = None
    ) -> None:
        """`q_sensor_from_segment` (N, 4) stands until the stance is complete, for good if `ticks` is 0.

        For good also that of the nodes `mounted` (N,), by default none.
        """
        count = len(q_sensor_from_segment)
        self._ticks = ticks
        self._facing = heading_turn(facing_rad)
        self._mounted = np.zeros(count, dtype=np.bool_) if mounted is None else mounted
        self._sum = np.zeros((count, 4))
        self._taken = np.zeros(count, dtype=np.int64)
        self.q_sensor_from_segment = q_sensor_from_segment.copy()
        """(N, 4)."""
        self.correction_rad = np.zeros(count)
        """(N,) what the headings of mounted nodes lacked when their stance was complete; 0 for others."""
        self.lean_rad = np.full(count, np.nan)
        """(N,) how far mounted nodes then leaned from the zero pose; NaN for others."""

    @property
    def known(self) -> Mask:
        """(N,) nodes whose stance is complete."""
        return self._taken >= self._ticks

    def add(self, q_world_from_sensor: Array, settled: Mask) -> Mask:
        """One tick: orientations (N, 4), and which of them count; returns who is complete now, (N,).

        A node that drops out begins again.
        """
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
            self._conclude(done)
        return done

    def _conclude(self, done: Mask) -> None:
        sits = done & ~self._mounted
        self.q_sensor_from_segment[sits] = multiply(conjugate(normalise(self._sum[sits])), self._facing)
        known = done & self._mounted
        segment = multiply(normalise(self._sum[known]), self.q_sensor_from_segment[known])
        correction = -heading_rad(multiply(segment, conjugate(self._facing)))
        self.correction_rad[known] = correction
        self.lean_rad[known] = angle_between(multiply(heading_turn(correction), segment), self._facing)

    def snapshot(self) -> object:
        """The state, to be given to `restore`."""
        parts = (self._sum, self._taken, self.q_sensor_from_segment, self.correction_rad, self.lean_rad)
        return tuple(part.copy() for part in parts)

    def restore(self, snapshot: object) -> None:
        """Go on from a snapshot."""
        if not isinstance(snapshot, tuple):
            raise TypeError("not a snapshot of this stance")
        parts = (part.copy() for part in snapshot)
        self._sum, self._taken, self.q_sensor_from_segment, self.correction_rad, self.lean_rad = parts
