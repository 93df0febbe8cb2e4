"""The slow way to the operator's posture after `engage`: when it ends, and when it took too long."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from common.clock import to_ns
from common.quaternion import Array
from common.wire.messages import Mask
from slave.guard.config import GuardConfig


def within(error_rad: Array, window_rad: float) -> Mask:
    """Which joints (J,) are near enough, on either side."""
    out: Mask = np.abs(error_rad) <= window_rad
    return out


class AlignProgress:
    """Watches each joint in `align`: when may the robot track, and has it taken too long.

    A joint has arrived once it was near for the dwell time. Not all need be near at one time: an operator who
    works moves some joint faster than `align` most of the time. One that is away again when `track` begins
    comes back slowly (`slave.limit.pace`).
    """

    def __init__(self, joint_names: Sequence[str], config: GuardConfig) -> None:
        self._names = tuple(joint_names)
        self._config = config
        self._dwell_ns = to_ns(config.align_dwell_s)
        self._timeout_ns = to_ns(config.align_timeout_s)
        self._began_ns = 0
        self._near: Mask = np.zeros(len(self._names), np.bool_)
        """(J,) which were near when they were looked at last."""
        self._near_since_ns: NDArray[np.int64] = np.zeros(len(self._names), np.int64)
        self._arrived: Mask = np.zeros(len(self._names), np.bool_)
        self._farthest = ""

    def begin(self, now_ns: int) -> None:
        """Start to count."""
        self._began_ns, self._farthest = now_ns, "no target yet"
        self._near = np.zeros(len(self._names), np.bool_)
        self._arrived = np.zeros(len(self._names), np.bool_)

    def done(self, now_ns: int, error_rad: Array, valid: Mask) -> bool:
        """Whether every valid joint, and at least one, was once within the window for the dwell time.

        `error_rad` (J,) is from setpoint to target. Joints that are not valid are not waited for.
        """
        near = within(error_rad, self._config.align_window_rad) & valid
        np.copyto(self._near_since_ns, now_ns, where=~(near & self._near))
        self._near = near
        self._arrived = self._arrived | near & (now_ns - self._near_since_ns >= self._dwell_ns)
        missing = valid & ~self._arrived
        if valid.any() and not missing.any():
            return True
        worst = int(np.argmax(np.where(missing, np.abs(error_rad), -1.0)))
        self._farthest = (
            f"{self._names[worst]} is {abs(error_rad[worst]):.2f} rad away"
            if valid.any()
            else "no joint is valid"
        )
        return False

    def overdue(self, now_ns: int) -> str | None:
        """Why alignment is given up, or None while there is time."""
        if now_ns - self._began_ns <= self._timeout_ns:
            return None
        return f"not aligned within {self._config.align_timeout_s:g} s: {self._farthest}"
