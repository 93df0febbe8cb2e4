"""The settings that each drive gets before it may move, by SDO. Pure."""

from __future__ import annotations

import math

from common.skeleton import Joint
from slave.servos.canopen.cia402 import CYCLIC_SYNCHRONOUS_POSITION
from slave.servos.canopen.config import CanopenConfig, DriveConfig, EffortSource, limits_rad
from slave.servos.canopen.pdo import (
    CURRENT,
    INPUTS_MAPPING,
    RPDO1,
    RPDO_MAPPING,
    TORQUE,
    TPDO1,
    TPDO2,
    TPDO3,
    TPDO_MAPPING,
)
from slave.servos.canopen.sdo import Read, Transfer, Write

_INVALID = 0x8000_0000
"""Bit of a PDO's COB-ID: it does not exist (while its mapping is changed)."""
_NO_RTR = 0x4000_0000
_EVERY_SYNC = 1
RATED_TORQUE, POLARITY = 0x6076, 0x607E
EFFORT = "effort"
"""The part of the settings that a drive may lack."""
_QUICK_STOP_AND_STAY = 6
"""605Ah: slow down on the quick stop ramp, then hold. Never let go."""
_ON_ABORT_QUICK_STOP = 3
"""6007h: a lost connection is answered by a quick stop."""
_MILLISECONDS = -3
_MODE_TRIES = 25


def transfers(config: CanopenConfig, drive: DriveConfig, joint: Joint, effort_syncs: int) -> list[Transfer]:
    """Everything from "are you a drive" to its limits, in this order; effort every so many SYNCs."""
    scale = drive.increments_per_rad
    lower, upper = sorted(
        round(drive.zero_increments + scale * limit)
        for limit in limits_rad(drive, joint.lower_rad, joint.upper_rad)
    )
    window = round(abs(scale) * math.radians(config.following_error_deg))
    ramp = round(abs(scale) * joint.max_acceleration_rad_s2)
    return [
        Read(0x1000, 0, 0xFFFF, 402, "a CiA 402 drive"),
        # whatever it says: two drives of one id differ in it, so that both their answers get through
        *(Read(0x1018, sub, 0, 0, "its identity", optional=True) for sub in (1, 2, 3, 4)),
        Write(0x1016, 1, 4, config.node_id << 16 | config.dead_ms),
        Write(0x1017, 0, 2, config.drive_heartbeat_ms),
        *_pdo(0x1400, RPDO1 + drive.id, RPDO_MAPPING),
        *_pdo(0x1800, TPDO1 + drive.id | _NO_RTR, TPDO_MAPPING),
        *(
            _pdo(0x1802, TPDO3 + drive.id | _NO_RTR, INPUTS_MAPPING)
            if joint.name in config.tell_inputs
            else ()
        ),
        Write(0x6007, 0, 2, _ON_ABORT_QUICK_STOP),
        Write(0x605A, 0, 2, _QUICK_STOP_AND_STAY),
        Write(0x6060, 0, 1, CYCLIC_SYNCHRONOUS_POSITION),
        Write(0x6065, 0, 4, window),
        Write(0x6066, 0, 2, config.following_error_ms),
        Write(0x607D, 1, 4, lower),
        Write(0x607D, 2, 4, upper),
        Write(0x6085, 0, 4, ramp),
        Write(0x60C2, 1, 1, 1000 // config.sync_hz),
        Write(0x60C2, 2, 1, _MILLISECONDS),
        *_effort(drive, effort_syncs),
        # the last: a drive may take a while to change its mode
        Read(
            0x6061,
            0,
            0xFF,
            CYCLIC_SYNCHRONOUS_POSITION,
            "the mode asked for, cyclic synchronous position (8),",
            again=_MODE_TRIES,
        ),
    ]


def _effort(drive: DriveConfig, every: int) -> list[Transfer]:
    """What it takes for a drive to tell its effort; nothing where the file wants none of it."""
    if drive.effort is EffortSource.NONE:
        return []
    entry = TORQUE if drive.effort is EffortSource.TORQUE else CURRENT
    return [
        Read(entry, 0, 0, 0, "its effort", part_of=EFFORT),
        Read(RATED_TORQUE, 0, 0, 0, "its rated torque", optional=True, part_of=EFFORT),
        Read(POLARITY, 0, 0, 0, "its polarity", optional=True, part_of=EFFORT),
        *_pdo(0x1801, TPDO2 + drive.id | _NO_RTR, (entry << 16 | 0x0010,), every=every, part_of=EFFORT),
    ]


def _pdo(
    index: int, cob_id: int, mapping: tuple[int, ...], *, every: int = _EVERY_SYNC, part_of: str = ""
) -> list[Transfer]:
    """CiA 301's order for a new mapping: off, no entries, the entries, their number, on."""
    entries = index + 0x200
    return [
        Write(index, 1, 4, cob_id | _INVALID, part_of),
        Write(index, 2, 1, every, part_of),
        Write(entries, 0, 1, 0, part_of),
        *(Write(entries, sub, 4, entry, part_of) for sub, entry in enumerate(mapping, 1)),
        Write(entries, 0, 1, len(mapping), part_of),
        Write(index, 1, 4, cob_id, part_of),
    ]
