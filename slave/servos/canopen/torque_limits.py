"""The torque limit that each drive is told with its target, in its own unit. Pure.

60E0h, 60E1h and 6072h are thousandths of the motor's rated torque, 6076h (CiA 402-2), on the motor's side of
the gear. The greater of both directions is written for both: which one a drive calls positive its polarity
(607Eh) does not say for certain, and an arm with too little torque against gravity would fall.
"""

from __future__ import annotations

import math

import numpy as np

from common.quaternion import Array
from common.skeleton import Skeleton
from slave.servos.canopen.config import CanopenConfig
from slave.servos.canopen.drive_config import DriveConfig, TorqueLimitBy
from slave.servos.canopen.mapping import Held
from slave.servos.canopen.setup import RATED_TORQUE

_THOUSANDTH = 0.001
_NOT_ASKED = 'the file does not ask for it (torque_limit = "none")'


class DriveTorqueLimits:
    """The limits of all J drives."""

    def __init__(self, config: CanopenConfig, skeleton: Skeleton) -> None:
        self._names = skeleton.joint_names
        self._drives = list(config.drives_of(skeleton).values())
        self._scale_nm = np.full(len(self._drives), np.nan)
        """A thousandth at the joint's output; NaN where the drive takes no limit."""
        self._most = np.array([most_thousandths(drive) for drive in self._drives], np.int64)
        self._takes_none = {
            i: _NOT_ASKED for i, one in enumerate(self._drives) if one.torque_limit is TorqueLimitBy.NONE
        }

    def configured(self, drive: int, held: Held, lacks: str) -> None:
        """A drive is set up: what was read of it, and why it takes no limit, or empty."""
        config = self._drives[drive]
        rated_nm = config.rated_torque_nm or _THOUSANDTH * held.get(RATED_TORQUE, 0)
        why = _why_none(config, lacks, rated_nm)
        self._takes_none.pop(drive, None)
        if why:
            self._takes_none[drive] = why
        scale_nm = _THOUSANDTH * rated_nm * config.gear_ratio * config.gear_efficiency
        self._scale_nm[drive] = np.nan if why else scale_nm

    def data(self, torque_nm: Array | None) -> dict[int, bytes]:
        """What each drive that takes a limit is told, by drive. `torque_nm`: (2, J) at the joint, or None."""
        taking = np.flatnonzero(~np.isnan(self._scale_nm)).tolist()
        if not taking:
            return {}
        told = self._most
        if torque_nm is not None:
            greatest_nm = np.abs(torque_nm).max(axis=0)
            asked = np.where(np.isfinite(greatest_nm), greatest_nm, np.inf) / self._scale_nm
            # upwards: never less than the motion needs
            told = np.minimum(np.ceil(np.nan_to_num(asked, nan=math.inf)), self._most).astype(np.int64)
        return {i: int(told[i]).to_bytes(2, "little") * entries(self._drives[i].torque_limit) for i in taking}

    @property
    def missing(self) -> dict[str, str]:
        """Why a joint's drive takes no limit, by joint."""
        return {self._names[drive]: self._takes_none[drive] for drive in sorted(self._takes_none)}


def most_thousandths(drive: DriveConfig) -> int:
    """What the drive may give where nothing else limits it."""
    return round(10.0 * (drive.most_torque_percent or 0.0))


def entries(by: TorqueLimitBy) -> int:
    """How many objects take the limit."""
    return 2 if by is TorqueLimitBy.BOTH_DIRECTIONS else 1


def _why_none(config: DriveConfig, lacks: str, rated_nm: float) -> str:
    if config.torque_limit is TorqueLimitBy.NONE:
        return _NOT_ASKED
    if lacks:
        return f"its drive takes none ({lacks})"
    return "" if rated_nm else "its drive has no rated torque (6076h): set rated_torque_nm"
