"""How fast each joint may follow: slowly in `align` and while it comes back, else at its own limits."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from common.clock import to_ns
from common.quaternion import Array
from common.wire.messages import Mask
from slave.guard.align import within
from slave.guard.config import GuardConfig
from slave.guard.limits import MotionLimits


class Pace:
    """The velocity and acceleration of each joint, step by step.

    In `track` a joint that was held and is valid again is slow until it is near its target. Where the target
    of any joint is so far away that it jumped, all come back slowly: all together at their limits would shake
    the light ones off their drives.

    Near means near for the dwell time, as in `align`. The tracker's target of a lost joint comes from
    elsewhere (the master sends 0) and crosses the window: it must not let the joint go as it passes.
    """

    def __init__(self, limits: MotionLimits, config: GuardConfig) -> None:
        self._limits = limits
        self._window_rad = config.align_window_rad
        self._jump_rad = config.jump_window_rad
        self._dwell_ns = to_ns(config.align_dwell_s)
        self._slow = (
            np.minimum(limits.max_velocity_rad_s, config.align_velocity_rad_s),
            np.minimum(limits.max_acceleration_rad_s2, config.align_acceleration_rad_s2),
        )
        self._away: Mask = np.zeros(len(limits.lower_rad), np.bool_)
        """(J,) joints that have not come back yet."""
        self._outside_ns: NDArray[np.int64] = np.zeros(len(limits.lower_rad), np.int64)

    def begin(self, now_ns: int) -> None:
        """`align` begins: no joint has been near for any time."""
        self._outside_ns.fill(now_ns)

    def aligning(self, now_ns: int, error_rad: Array, valid: Mask) -> tuple[Array, Array]:
        """Velocity and acceleration (J,) for this step of `align`; `error_rad` (J,): setpoint to target.

        Joints that are not valid do not align with the rest, and of the others some may have moved away from
        the operator again: they come back in `track`.
        """
        self._away = self._not_yet(now_ns, error_rad, valid)
        return self._slow

    def tracking(self, now_ns: int, error_rad: Array, valid: Mask, held_back: Mask) -> tuple[Array, Array]:
        """Velocity and acceleration (J,) for this step of `track`; `error_rad` (J,): setpoint to target.

        `held_back`: joints that may not go to their targets, since something is near. Once far from them they
        come back slowly, and only they: their targets did not jump.
        """
        fast = self._limits.max_velocity_rad_s, self._limits.max_acceleration_rad_s2
        self._away = self._away | (held_back & ~within(error_rad, self._jump_rad))
        jumped = bool((valid & ~self._away & ~within(error_rad, self._jump_rad)).any())
        if not jumped and valid.all() and not self._away.any():
            return fast
        self._away = ~valid | jumped | (self._away & self._not_yet(now_ns, error_rad, valid))
        return np.where(self._away, self._slow[0], fast[0]), np.where(self._away, self._slow[1], fast[1])

    def _not_yet(self, now_ns: int, error_rad: Array, valid: Mask) -> Mask:
        """(J,) joints that have not been near for the dwell time."""
        outside = ~valid | ~within(error_rad, self._window_rad)
        np.copyto(self._outside_ns, now_ns, where=outside)
        out: Mask = outside | (now_ns - self._outside_ns < self._dwell_ns)
        return out
