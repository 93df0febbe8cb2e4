"""The slow way to the operator's posture after `engage`: when it ends, and when it took too long."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from common.clock import to_ns
from common.quaternion import Array
from common.wire.messages import Mask
from slave.guard.config import GuardConfig


def within(error_rad: Array, window_rad: float) -> Mask:
    """Which joints (J,) are near enough, on either side."""
    out: Mask = np.abs(error_rad) <= window_rad
    return out


class AlignProgress:
    """Watches the whole robot in `align`: when may it track, and has it taken too long."""

    def __init__(self, joint_names: Sequence[str], config: GuardConfig) -> None:
        self._names = tuple(joint_names)
        self._config = config
        self._dwell_ns = to_ns(config.align_dwell_s)
        self._timeout_ns = to_ns(config.align_timeout_s)
        self._began_ns = 0
        self._within_since_ns: int | None = None
        self._farthest = ""

    def begin(self, now_ns: int) -> None:
        """Start to count."""
        self._began_ns, self._within_since_ns, self._farthest = now_ns, None, "no target yet"

    def done(self, now_ns: int, error_rad: Array, valid: Mask) -> bool:
        """Whether every valid joint, and at least one, has been within the window for the dwell time.

        `error_rad` (J,) is from setpoint to target. Joints that are not valid are not waited for.
        """
        near = within(error_rad, self._config.align_window_rad)
        if not valid.any() or not (near | ~valid).all():
            self._within_since_ns = None
            worst = int(np.argmax(np.where(valid, np.abs(error_rad), -1.0)))
            self._farthest = f"{self._names[worst]} is {abs(error_rad[worst]):.2f} rad away"
            if not valid.any():
                self._farthest = "no joint is valid"
            return False
        if self._within_since_ns is None:
            self._within_since_ns = now_ns
        return now_ns - self._within_since_ns >= self._dwell_ns

    def overdue(self, now_ns: int) -> str | None:
        """Why alignment is given up, or None while there is time."""
        if now_ns - self._began_ns <= self._timeout_ns:
            return None
        what = "not aligned" if self._within_since_ns is None else "not aligned for long enough"
        why = f": {self._farthest}" if self._within_since_ns is None else ""
        return f"{what} within {self._config.align_timeout_s:g} s{why}"
