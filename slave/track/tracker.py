"""What every strategy does: take samples of the operator, and give the target for this instant."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

from common.quaternion import Array


@dataclass(frozen=True, slots=True)
class TrackTarget:
    """Where the joints should go now."""

    position_rad: Array
    """(J,)"""
    velocity_rad_s: Array
    """(J,) rate of change of `position_rad`; for feed-forward and for judging, not for integration."""

    @property
    def finite(self) -> bool:
        """Whether every value is a number."""
        # a sum of squares is finite only if every value is, and costs a third of asking each
        return math.isfinite(
            self.position_rad @ self.position_rad + self.velocity_rad_s @ self.velocity_rad_s
        )


class Tracker(Protocol):
    """One strategy. All times are ns of the slave's clock."""

    def reset(self) -> None:
        """Forget every sample: the next one starts afresh."""
        ...

    def accept(self, sampled_ns: int, now_ns: int, position_rad: Array, velocity_rad_s: Array) -> None:
        """Take a sample (J,) that was captured at `sampled_ns` and arrived at `now_ns`.

        A sample captured no later than the newest one is ignored. All values must be finite; a
        velocity of exactly zero on every joint means that velocities are not known.
        """
        ...

    def target(self, now_ns: int) -> TrackTarget | None:
        """Where to be now, or None before the first sample.

        It changes nothing: the slave also asks where it would be later, if no sample came any more.
        """
        ...
