"""One tick of the whole suit: what the nodes answered."""

from __future__ import annotations

from dataclasses import dataclass

from common.quaternion import Array
from common.wire.messages import Mask


@dataclass(frozen=True, slots=True)
class Sweep:
    """One tick's answers, in node order. Where a node is not fresh its last good readings stand."""

    tick: int
    sampled_ns: int
    """SYNC sent; of a suit with free-running nodes the instant on which all are resampled."""
    frames_in_ns: int
    """The last awaited node answered, or the window closed without it."""
    acc_m_s2: Array
    """(N, 3) specific force, sensor frame; zero before the first answer."""
    gyr_rad_s: Array
    """(N, 3) rotation rate, sensor frame; zero before the first answer."""
    mag_ut: Array
    """(N, 3) magnetic field, sensor frame; a row of NaN where there is no reading."""
    fresh: Mask
    """(N,) answered this tick soundly."""
    lost: Mask
    """(N,) missing for `lost_after` ticks or more, or never heard yet."""
    q_world_from_sensor: Array | None = None
    """(N, 4) orientations that units have fused themselves, NaN for others; None: no unit has."""
