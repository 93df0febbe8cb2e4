"""`[servos.canopen.drives.<joint>]`: one CiA 402 drive, and what it is told in its own units."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Literal

from pydantic import Field

from common.config.section import RelativePath, Section
from common.skeleton import Joint

INCREMENTS_PER_TURN = 65536
"""The resolution of a motor's own encoder."""
_LIMIT_MARGIN_RAD = math.radians(2.0)
"""A drive's software limits lie this far beyond the joint's: the guard limits first."""


class EffortSource(StrEnum):
    """Where a drive's effort comes from."""

    TORQUE = "torque"
    """Actual torque, 6077h."""
    CURRENT = "current"
    """Actual current, 6078h, of a drive without 6077h: a motor's torque goes with it."""
    NONE = "none"


class TorqueLimitBy(StrEnum):
    """Which object of a drive takes the torque limit at every SYNC."""

    BOTH_DIRECTIONS = "60E0h"
    """60E0h and 60E1h, which count in every mode."""
    MAX_TORQUE = "6072h"
    """Max torque. Of some drives it counts in torque modes only: look it up in the manual first."""
    NONE = "none"


SAYS_NONE = 'the file says so (effort = "none")'


class DriveConfig(Section):
    """`[servos.canopen.drives.<joint>]`."""

    id: int = Field(ge=1, le=126)
    """Its CANopen node id."""
    bus: str = Field(min_length=1)
    """Name of the bus it hangs on."""
    gear_ratio: float = Field(1.0, gt=0.0, le=10_000.0)
    """Turns of the motor for one turn of the joint."""
    increments_per_turn: int = Field(INCREMENTS_PER_TURN, ge=256, le=2**24)
    """The resolution of the motor's encoder."""
    reversed: bool = False
    """True: the drive's position falls as the joint's angle rises."""
    zero_increments: int = Field(0, ge=-(2**31), le=2**31 - 1)
    """The drive's position where the joint's angle is 0."""
    counts_over: bool = False
    """True: its position (6064h) goes from 2³¹ − 1 on to −2³¹, and it takes targets in the same way, as its
    range (607Bh) is all 32 bits. Only then may the joint's range cross that point."""
    lower_deg: float | None = Field(None, ge=-360.0, le=360.0)
    """Lower software limit; None: 2° beyond the joint's own."""
    upper_deg: float | None = Field(None, ge=-360.0, le=360.0)

    eds: RelativePath | None = None
    """The maker's EDS or DCF file of the drive: held against this file before anything is opened."""
    encoder: int | None = Field(None, ge=0x2000, le=0x9FFF)
    """Object of an encoder at the joint's output, an AS5045's 16-bit word; None: the drive's own 6064h."""
    mode: Literal[7, 8] | None = None
    """Mode of operation: 8 cyclic synchronous, 7 interpolated position. None: by 6502h, 8 if it has both."""
    homed: bool = False
    """True: its encoder is not absolute. It must say that it has been homed since it was switched on."""
    boots_twice: bool = False
    """True: it reports its start twice, by its manual. Else that shows that two drives have its id."""
    holds_itself: bool = False
    """True: a brake or the gear holds the joint without torque, as a drive without 605Ah or 6007h needs."""
    unused_status_bits: list[Literal[4, 7, 9, 11, 12]] = Field(default_factory=list)
    """Bits of its statusword, of 4, 7, 9, 11 and 12, that its manual gives no meaning or another one."""

    effort: EffortSource = EffortSource.TORQUE
    """What tells its effort. A drive that lacks the object tells none, which is said."""
    rated_torque_nm: float | None = Field(None, gt=0.0, le=1000.0)
    """Of the motor, without gear: what 1000 of 6077h or 6078h is. None: the drive's own 6076h."""
    gear_efficiency: float = Field(1.0, gt=0.1, le=1.0)
    """Share of the motor's torque that the gear lets through."""
    effort_reversed: bool = False
    """True: the drive tells torque against its own direction of position, though 607Eh does not say so."""

    # from a file it comes as text, which strict sections would refuse
    torque_limit: TorqueLimitBy = Field(TorqueLimitBy.NONE, strict=False)
    """While the robot follows, the drive may push no harder than the motion needs: which of its objects says
    so. Should the slave die, the drive brakes with no more torque than it was told last."""
    most_torque_percent: float | None = Field(None, gt=0.0, le=1000.0)
    """Of its rated torque, with `torque_limit`: what it may give where nothing else limits it."""

    @property
    def increments_per_rad(self) -> float:
        """Signed: below 0 where reversed."""
        scale = self.gear_ratio * self.increments_per_turn / (2.0 * math.pi)
        return -scale if self.reversed else scale


def limits_rad(drive: DriveConfig, lower_rad: float, upper_rad: float) -> tuple[float, float]:
    """The software limits of a drive at a joint of these limits, rad."""
    lower = lower_rad - _LIMIT_MARGIN_RAD if drive.lower_deg is None else math.radians(drive.lower_deg)
    upper = upper_rad + _LIMIT_MARGIN_RAD if drive.upper_deg is None else math.radians(drive.upper_deg)
    return lower, upper


@dataclass(frozen=True, slots=True)
class NetworkTimes:
    """What all drives of a robot are told alike."""

    node_id: int
    """The slave's own."""
    dead_ms: int
    heartbeat_ms: int
    """Between two of the slave's."""
    drive_heartbeat_ms: int
    period_ms: int
    """Between two SYNCs."""
    effort_syncs: int
    following_error_deg: float
    following_error_ms: int


@dataclass(frozen=True, slots=True)
class DriveSettings:
    """What one drive is told, in its own units."""

    drive: DriveConfig
    times: NetworkTimes
    tells_inputs: bool
    lower: int
    """Software limits, increments."""
    upper: int
    window: int
    """Following error allowed, increments."""
    ramp: int
    """Quick stop ramp, increments/s²."""

    @classmethod
    def of(cls, drive: DriveConfig, joint: Joint, times: NetworkTimes, tells_inputs: bool) -> DriveSettings:
        """The settings of a joint's drive."""
        scale = drive.increments_per_rad
        limits = limits_rad(drive, joint.lower_rad, joint.upper_rad)
        lower, upper = sorted(round(drive.zero_increments + scale * limit) for limit in limits)
        window = round(abs(scale) * math.radians(times.following_error_deg))
        ramp = round(abs(scale) * joint.max_acceleration_rad_s2)
        return cls(drive, times, tells_inputs, lower, upper, window, ramp)

    @property
    def crosses(self) -> bool:
        """Whether the joint's range crosses ±2³¹ increments, so that no software limits can be told."""
        return not -(2**31) <= self.lower <= self.upper < 2**31

    @property
    def eds(self) -> Path | None:
        """The drive's EDS."""
        return self.drive.eds
