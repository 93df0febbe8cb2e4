"""A lost node without a magnetometer comes back with the heading it had, not its filter's zero."""

from __future__ import annotations

import numpy as np

from common.quaternion import IDENTITY, Array, conjugate, heading_rad, heading_turn, multiply
from common.wire.messages import Mask


class HeadingMemory:
    """Turns about the vertical, (N, 4), that carry each six-axis node's heading over a loss.

    What the segment turned meanwhile stays unknown; with a magnetometer the filter finds the heading itself.
    """

    def __init__(self, count: int) -> None:
        self.turn: Array = np.tile(IDENTITY, (count, 1))
        self._held = np.full((count, 4), np.nan)

    def lose(self, nodes: Mask, q_world_from_sensor: Array) -> None:
        """Keep the orientations (N, 4), as the filters give them, of nodes that were trusted until now."""
        self._held[nodes] = multiply(self.turn[nodes], q_world_from_sensor[nodes])

    def find(self, nodes: Mask, q_world_from_sensor: Array, magnetic_rad: Array) -> None:
        """Turn the restarted nodes so that their heading goes on from the one held.

        Only those without a magnetometer, whose `magnetic_rad` (N,) is NaN.
        """
        back = nodes & np.isfinite(self._held[:, 0]) & np.isnan(magnetic_rad)
        between = multiply(self._held[back], conjugate(q_world_from_sensor[back]))
        self.turn[back] = heading_turn(heading_rad(between))

    def stand(self, nodes: Mask, correction_rad: Array, q_world_from_sensor: Array, mag_ut: Array) -> None:
        """Turn those of the nodes without a magnetometer by what a zero pose gives, (N,)."""
        six_axis = nodes & np.isnan(mag_ut[:, 0])
        self.turn[six_axis] = multiply(heading_turn(correction_rad[six_axis]), self.turn[six_axis])

    def due(self) -> bool:
        """Never: nothing is corrected from tick to tick."""
        return False

    def correct(self, q_world_from_sensor: Array, mag_ut: Array, alignment: Array, usable: Mask) -> None:
        """Nothing."""
