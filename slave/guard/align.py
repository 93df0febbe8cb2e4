"""The slow way to the operator's posture: the whole robot after `engage`, single joints after a loss."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from common.clock import to_ns
from common.quaternion import Array
from common.wire.messages import Mask
from slave.guard.config import GuardConfig
from slave.limit.limit import Limits


def within(error_rad: Array, window_rad: float) -> Mask:
    """Which joints (J,) are near enough, on either side."""
    out: Mask = np.abs(error_rad) <= window_rad
    return out


class Alignment:
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


class Rejoin:
    """Joints that must first come back to the operator: slow until near, then as fast as the rest.

    They were held in `track` and are valid again. Or the target of any is so far away that it jumped: then
    all come back slowly, since all together at their limits would shake the light ones off their drives.

    Near for the dwell time, as in `align`: a target that is still on its way from where the tracker had the
    lost joint (the master says 0) crosses the window, and must not let the joint go as it passes.
    """

    def __init__(self, limits: Limits, config: GuardConfig) -> None:
        self._limits = limits
        self._window_rad = config.align_window_rad
        self._jump_rad = config.jump_window_rad
        self._dwell_ns = to_ns(config.align_dwell_s)
        self.slow_velocity_rad_s: Array = np.minimum(limits.max_velocity_rad_s, config.align_velocity_rad_s)
        """(J,) the speed of `align`."""
        self.slow_acceleration_rad_s2: Array = np.minimum(
            limits.max_acceleration_rad_s2, config.align_acceleration_rad_s2
        )
        """(J,) and its acceleration."""
        self._away: Mask = np.zeros(len(limits.lower_rad), np.bool_)
        self._outside_ns: NDArray[np.int64] = np.zeros(len(limits.lower_rad), np.int64)

    def begin(self, now_ns: int, valid: Mask) -> None:
        """`track` begins: joints that are not valid did not align with the rest."""
        self._away = ~valid
        self._outside_ns.fill(now_ns)

    def maxima(self, now_ns: int, error_rad: Array, valid: Mask) -> tuple[Array, Array]:
        """Velocity and acceleration (J,) for this step; `error_rad` (J,) is from setpoint to target."""
        jumped = bool((valid & ~self._away & ~within(error_rad, self._jump_rad)).any())
        if not jumped and valid.all() and not self._away.any():
            return self._limits.max_velocity_rad_s, self._limits.max_acceleration_rad_s2
        outside = ~valid | ~within(error_rad, self._window_rad)
        np.copyto(self._outside_ns, now_ns, where=outside)
        not_yet = outside | (now_ns - self._outside_ns < self._dwell_ns)
        self._away = ~valid | jumped | (self._away & not_yet)
        return (
            np.where(self._away, self.slow_velocity_rad_s, self._limits.max_velocity_rad_s),
            np.where(self._away, self.slow_acceleration_rad_s2, self._limits.max_acceleration_rad_s2),
        )
