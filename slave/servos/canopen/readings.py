"""What the drives answer, SYNC by SYNC, as the slave reads it: angles, encoder counts and efforts. Pure."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from common.skeleton import Skeleton
from common.wire.messages import Mask
from slave.encoders.counts import Encoders
from slave.servos.canopen import pdo
from slave.servos.canopen.answers import DriveAnswers, SyncAnswers
from slave.servos.canopen.config import CanopenConfig
from slave.servos.canopen.effort import DriveEfforts
from slave.servos.canopen.units import DriveUnits
from slave.servos.servos import EncoderReading


class DriveReadings:
    """The newest reading of all J drives, put together once all have answered."""

    def __init__(
        self,
        config: CanopenConfig,
        skeleton: Skeleton,
        units: DriveUnits,
        encoders: Encoders,
        *,
        on_flags: Callable[[Sequence[str]], None],
    ) -> None:
        """`on_flags`: gets each encoder's fault as text where any has changed."""
        drives = config.drives_of(skeleton).values()
        self._units, self._encoders, self._on_flags = units, encoders, on_flags
        self.answers = SyncAnswers(len(drives), [drive.unused_status_bits for drive in drives])
        self.efforts = DriveEfforts(config, skeleton)
        self.single: Mask = np.array([drive.encoder is None for drive in drives])
        """(J,) whose angle the drive alone tells."""
        self._flags: NDArray[np.uint16] = np.zeros(len(drives), np.uint16)
        self._effort_is_newer = False
        nothing = np.zeros(len(drives), np.int64)
        self._reading = EncoderReading(0, nothing, np.zeros(len(drives), np.bool_))

    @property
    def complete(self) -> bool:
        """Whether every drive has answered this SYNC, efforts included."""
        return self.answers.complete and self.efforts.complete

    def seen(self, synced_ns: int) -> DriveAnswers:
        """All answers to the SYNC of that time so far."""
        seen = self.answers.of(synced_ns)
        if not self.single.any():
            return seen
        shown = self._encoders.counts(self._units.angle_rad(seen.position))
        return replace(seen, encoder_counts=np.where(self.single, shown, seen.encoder_counts))

    def take_effort(self, drive: int, data: bytes) -> bool:
        """One drive's telling. False where it is not of the right length."""
        taken = self.efforts.take(drive, data)
        self._effort_is_newer = self._effort_is_newer or taken
        return taken

    def publish(self, synced_ns: int, stamp_error_ns: int) -> None:
        """Make what has come the newest reading; its stamp may be so wrong."""
        self._effort_is_newer = False
        seen = self.seen(synced_ns)
        self._reading = EncoderReading(
            synced_ns, seen.encoder_counts, seen.encoder_valid, self._units.angle_rad(seen.position),
            self.efforts.joint_nm, stamp_error_ns,
        )  # fmt: skip
        if (seen.encoder_flags != self._flags).any():
            self._flags = seen.encoder_flags
            self._on_flags([pdo.encoder_words(flag) for flag in seen.encoder_flags.tolist()])

    @property
    def newest(self) -> EncoderReading:
        """Efforts that are told more seldom than positions join it when they come."""
        if self._effort_is_newer and self.efforts.complete:
            self._effort_is_newer = False
            self._reading = replace(self._reading, effort_nm=self.efforts.joint_nm)
        return self._reading
