"""The newest joint angles: how soon the joints stood after a fault, and whether they move in `hold`. Pure."""

from __future__ import annotations

from collections import deque

import numpy as np

from common.clock import NS_PER_S, to_s
from common.quaternion import Array
from common.skeleton import Skeleton
from common.wire.messages import Mask, RobotState
from deploy.measure.stillness import StoppingMotion, stillness

KEPT = 400
"""States: 8 s."""
BRAKES_S = 0.7
"""A robot that holds has come to rest by then; what moves later moves by itself."""


class MotionWatch:
    """The newest states' encoders, and the farthest that any joint went while the robot was to stand."""

    def __init__(self, skeleton: Skeleton) -> None:
        self._skeleton = skeleton
        self._rows: deque[tuple[int, Array, Array]] = deque(maxlen=KEPT)
        self._held_ns: int | None = None
        self._rest_rad: Array | None = None
        self._strayed_rad: float | None = None

    def see(self, state: RobotState) -> None:
        """Take a state. One that is older than the last is of another process: its robot stands elsewhere."""
        if self._rows and state.sent_ns < self._rows[-1][0]:
            self.forget()
        self._rows.append((state.sent_ns, state.setpoint_rad, state.position_rad))
        if state.guard != "hold":
            self._held_ns = self._rest_rad = None
            return
        if self._held_ns is None:
            self._held_ns = state.sent_ns
        known = state.encoder_valid
        if state.sent_ns - self._held_ns < BRAKES_S * NS_PER_S or not known.any():
            return
        if self._rest_rad is None:
            self._rest_rad = np.full_like(state.position_rad, np.nan)
        # one encoder that does not answer must not hide what the other joints do
        self._rest_rad = np.where(known & np.isnan(self._rest_rad), state.position_rad, self._rest_rad)
        way_rad = np.abs(state.position_rad - self._rest_rad)[known]
        # an angle that is called valid and is no number may be anywhere
        strayed_rad = float(np.where(np.isfinite(way_rad), way_rad, np.inf).max())
        self._strayed_rad = max(self._strayed_rad or 0.0, strayed_rad)

    def forget(self) -> None:
        """The process has ended: what comes next is another robot's."""
        self._rows.clear()
        self._held_ns = self._rest_rad = None

    def take_strayed(self) -> float | None:
        """How far it went while it was to stand, rad, since the last call; None: it was not to stand."""
        strayed_rad, self._strayed_rad = self._strayed_rad, None
        return strayed_rad

    def newest_ns(self) -> int:
        """The robot's clock when it sent the newest state; 0 before any."""
        return self._rows[-1][0] if self._rows else 0

    def standstill_s(self, fault_ns: int, concerned: Mask | None = None) -> float | None:
        """From a moment of its clock until the joints (J,), or all, stood for good; None: not known."""
        rows = [row for row in self._rows if row[0] >= fault_ns - NS_PER_S // 5]
        if not rows or rows[-1][0] - fault_ns < NS_PER_S // 2 or rows[0][0] > fault_ns:
            return None
        at_s = np.array([to_s(at_ns - fault_ns) for at_ns, _, _ in rows])
        course = StoppingMotion(at_s, np.array([s for _, s, _ in rows]), np.array([p for _, _, p in rows]))
        everyone = np.ones(len(self._skeleton.joints), np.bool_)
        return stillness(course, self._skeleton, everyone if concerned is None else concerned).standstill_s
