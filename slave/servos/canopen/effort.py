"""The effort that each drive tells, as torque at its joint's output. Pure.

6077h and 6078h are in thousandths of the motor's rating (CiA 402-2), on the motor's side of the gear.
"""

from __future__ import annotations

import numpy as np

from common.quaternion import Array
from common.skeleton import Skeleton
from slave.servos.canopen.config import CanopenConfig
from slave.servos.canopen.drive_config import SAYS_NONE, DriveConfig, EffortSource
from slave.servos.canopen.mapping import Held
from slave.servos.canopen.pdo import EFFORT_BYTES
from slave.servos.canopen.setup import POLARITY, RATED_TORQUE

_OF_POSITION, _OF_TORQUE = 0x80, 0x20
"""Bits of 607Eh. A drive that turns round only one of them tells torque against its own position."""
_MISSED = 3
"""Tellings in a row after which a drive's effort is not known any more."""
_THOUSANDTH = 0.001


class DriveEfforts:
    """The newest effort of all J drives."""

    def __init__(self, config: CanopenConfig, skeleton: Skeleton) -> None:
        self._names = skeleton.joint_names
        self._drives = list(config.drives_of(skeleton).values())
        self._patience = _MISSED * config.effort_syncs(skeleton)
        count = len(self._drives)
        self._scale_nm = np.full(count, np.nan)
        """A thousandth at the joint's output."""
        self._thousandths = np.zeros(count)
        self._age = np.full(count, self._patience + 1)
        """SYNCs since it was told."""
        self._tells_none: dict[int, str] = {}
        self._at_every_sync = config.effort_syncs(skeleton) == 1
        self._awaited: set[int] = set()

    def configured(self, drive: int, held: Held, lacks: str) -> None:
        """A drive is ready to tell: what was read of it, and why it tells none, or empty."""
        config = self._drives[drive]
        rated_nm = config.rated_torque_nm or _THOUSANDTH * held.get(RATED_TORQUE, 0)
        why = _why_none(config, lacks, rated_nm)
        self._tells_none.pop(drive, None)
        if why:
            self._tells_none[drive] = why
        polarity = held.get(POLARITY, 0)
        against = bool(polarity & _OF_POSITION) != bool(polarity & _OF_TORQUE)
        turned = config.reversed ^ against ^ config.effort_reversed
        scale_nm = _THOUSANDTH * rated_nm * config.gear_ratio * config.gear_efficiency
        self._scale_nm[drive] = np.nan if why else -scale_nm if turned else scale_nm
        # it has not told anything yet, and is not late either
        self._thousandths[drive], self._age[drive] = np.nan, 0

    def take(self, drive: int, data: bytes) -> bool:
        """One drive's telling. False where it is not of the right length."""
        if len(data) != EFFORT_BYTES:
            return False
        self._awaited.discard(drive)
        self._thousandths[drive] = int.from_bytes(data, "little", signed=True)
        self._age[drive] = 0
        return True

    def asked(self) -> None:
        """A SYNC is sent."""
        self._age += 1
        if self._at_every_sync:
            telling = ~np.isnan(self._scale_nm) & (self._age <= self._patience)
            self._awaited = set(np.flatnonzero(telling).tolist())

    @property
    def complete(self) -> bool:
        """Whether every effort of this SYNC is here, so that a reading may hold those of its own moment."""
        return not self._awaited

    @property
    def joint_nm(self) -> Array | None:
        """(J,) N m at the joint; NaN where it is not known. None where no drive tells any."""
        if np.isnan(self._scale_nm).all():
            return None
        out: Array = np.where(self._age <= self._patience, self._scale_nm * self._thousandths, np.nan)
        return out

    @property
    def missing(self) -> dict[str, str]:
        """Why the effort of a joint is not known, by joint."""
        late = np.flatnonzero(~np.isnan(self._scale_nm) & (self._age > self._patience)).tolist()
        words = dict.fromkeys(late, "its drive has stopped telling it") | self._tells_none
        return {self._names[drive]: words[drive] for drive in sorted(words)}


def _why_none(config: DriveConfig, lacks: str, rated_nm: float) -> str:
    if config.effort is EffortSource.NONE:
        return SAYS_NONE
    if lacks:
        return f"its drive tells none ({lacks})"
    return "" if rated_nm else "its drive has no rated torque (6076h): set rated_torque_nm"
