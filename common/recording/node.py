"""One node's recording on an even grid, as everything that reads recordings takes it."""

from __future__ import annotations

from dataclasses import dataclass

from common.quaternion import Array
from common.wire.messages import Mask


@dataclass(frozen=True, slots=True)
class NodeRecording:
    """One node's readings as they came, evenly spaced; a row of NaN stands where a sample is missing."""

    name: str
    """The segment, or the file's stem for a single unit."""
    rate_hz: float
    acc_m_s2: Array
    """(T, 3), sensor frame."""
    gyr_rad_s: Array
    """(T, 3), sensor frame."""
    mag_ut: Array | None = None
    """(T, 3), sensor frame; None without a magnetometer."""
    counts: bool = False
    """True: the three arrays hold the converters' raw counts, of which the unit is not known."""
    as_read: NodeRecording | None = None
    """Where a calibration has been applied, the readings before it: only those show the ends of a range."""
    notes: tuple[str, ...] = ()
    """What was repaired in the recording, for a person."""
    q_world_from_sensor: Array | None = None
    """(T, 4) wxyz in the file's own world frame, such as optical truth; None where the file has none."""
    movement: Mask | None = None
    """(T,) the phase that counts; None where the file tells none."""
    position_m: Array | None = None
    """(T, 3) of a marker, in the file's own world frame; None where the file has none."""
    start_s: float = 0.0
    """Time of the first row, by the file's own clock."""
    assumed: frozenset[str] = frozenset()
    """Quantities (acc, gyr, mag) of which the file tells no unit: taken as SI."""

    @property
    def duration_s(self) -> float:
        """Length of the recording."""
        return len(self.gyr_rad_s) / self.rate_hz
