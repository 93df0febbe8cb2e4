"""What every robot's servos can do: take setpoints, give encoder counts, hold."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from common.metrics.slave import ServoMetrics
from common.quaternion import Array
from common.wire.messages import Mask


@dataclass(frozen=True, slots=True)
class EncoderReading:
    """One reading of all encoders at the output shafts."""

    read_ns: int
    """When the counts were taken, ns of the slave's clock."""
    counts: NDArray[np.int64]
    """(J,) 0..4095, raw: neither zero nor direction applied."""
    valid: Mask
    """(J,) False where the encoder does not answer or says it cannot be trusted."""
    drive_rad: Array | None = None
    """(J,) the joints' angles by the drives' own encoders at that time; None where they have none."""
    effort_nm: Array | None = None
    """(J,) torque of each motor at the joint's output, N m, positive in the joint's positive direction; NaN
    where a drive tells none. None where no drive does."""
    stamp_error_ns: int = 0
    """The drives may have read their angles so much before or after `read_ns`."""


def check_setpoint(position_rad: Array, joints: int) -> None:
    """Raises ValueError where setpoints are not one finite angle a joint."""
    if position_rad.shape != (joints,) or not np.isfinite(position_rad).all():
        raise ValueError(f"setpoints must be {joints} finite angles, not {position_rad}")


def check_torque_limit(torque_nm: Array | None, joints: int) -> None:
    """Raises ValueError where torque limits are not a range a joint. Infinite: the drive's own limit."""
    if torque_nm is not None and not (
        torque_nm.shape == (2, joints) and (torque_nm[0] <= torque_nm[1]).all()
    ):
        raise ValueError(f"torque limits must be {joints} ranges, not {torque_nm}")


@runtime_checkable
class LimitsTorque(Protocol):
    """What servos can do besides, whose drives take a torque limit at every setpoint."""

    def limit_torque(self, torque_nm: Array | None) -> None:
        """Least and greatest torque (2, J) of each drive from the next setpoint on, N m at the joint.

        It never widens what the drive may do by itself. None: as much as it has. Never blocks. Raises
        ValueError where it is not a range a joint.
        """
        ...

    @property
    def no_torque_limit(self) -> Mapping[str, str]:
        """Why the drive of a joint takes no limit, by joint; empty where all do."""
        ...


class Servos(Protocol):
    """The robot as the slave sees it. No method blocks for longer than `start` and `stop` must."""

    def start(self) -> None:
        """Open the drives; they hold where they stand. Raises RobotError where that fails."""
        ...

    def write(self, position_rad: Array) -> None:
        """Hand over setpoints (J,); the newest wins. Never blocks."""
        ...

    def read(self) -> EncoderReading:
        """The newest reading; `read_ns` is its time. Never blocks."""
        ...

    def faults(self) -> Mapping[str, str]:
        """The faults of drives and encoders as text, by joint; empty if there are none."""
        ...

    def quick_stop(self, stop: bool) -> None:
        """True, on an e-stop: the drives brake and stay, whatever is written. False, after the reset.

        Never blocks.
        """
        ...

    def metrics(self) -> ServoMetrics:
        """What was counted and measured since the start."""
        ...

    def stop(self) -> None:
        """Let go of the drives, which hold by themselves. Safe to call twice."""
        ...
