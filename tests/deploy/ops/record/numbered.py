"""Messages of which only the number matters."""

from __future__ import annotations

import numpy as np

from common.wire.codec import encode
from common.wire.messages import Command, CommandStamps, RobotState

_VALID, _ANGLES = np.ones(3, np.bool_), np.zeros(3)


def command(sequence: int, lease: int = 5) -> bytes:
    """A command, encoded."""
    stamps = CommandStamps(1, 2, 3, 4)
    return encode(
        Command(
            robot="robot-1",
            lease=lease,
            sequence=sequence,
            tick=sequence,
            stamps=stamps,
            deadman_held=True,
            valid=_VALID,
            position_rad=_ANGLES,
            velocity_rad_s=_ANGLES,
        )
    )


def state(sequence: int, instance: int = 1) -> bytes:
    """A state, encoded."""
    return encode(
        RobotState(
            robot="robot-1",
            sequence=sequence,
            sent_ns=1,
            encoder_ns=1,
            guard="hold",
            reason="",
            operator="",
            encoder_valid=_VALID,
            position_rad=_ANGLES,
            setpoint_rad=_ANGLES,
            echo=None,
            master_offset_ns=0,
            offset_bound_ns=-1,
            instance=instance,
        )
    )
