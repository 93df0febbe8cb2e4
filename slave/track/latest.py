"""Strategy `latest`: the newest sample until the next. A staircase; what the others are measured against."""

from __future__ import annotations

import numpy as np

from common.quaternion import Array
from slave.track.tracker import TrackTarget


class Latest:
    """A `Tracker` that repeats the newest sample."""

    def __init__(self) -> None:
        self._target: TrackTarget | None = None
        self._sampled_ns = 0

    def reset(self) -> None:
        """Forget the sample."""
        self._target = None

    def accept(self, sampled_ns: int, now_ns: int, position_rad: Array, velocity_rad_s: Array) -> None:
        """Take a sample (J,) if it is newer; its velocity is not used."""
        if self._target is not None and sampled_ns <= self._sampled_ns:
            return
        self._sampled_ns = sampled_ns
        self._target = TrackTarget(position_rad.copy(), np.zeros_like(position_rad))

    def target(self, now_ns: int) -> TrackTarget | None:
        """The newest sample, at rest."""
        return self._target
