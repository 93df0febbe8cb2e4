"""Which joints move without a command, or against their command. Pure.

Servos that have settled at setpoints that all stand must stay there. While setpoints move a servo follows
late, but never leaves the span of the last setpoints far behind, outwards. Both are judged by distance,
reading by reading: a joint that runs away at 30°/s is found before it has turned by a degree.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from common.clock import NS_PER_MS, NS_PER_S
from common.quaternion import Array
from common.wire.messages import Mask

STILL_RAD = math.radians(0.5)
"""A joint that has settled may be this far from where it settled: six counts of a 12-bit encoder."""
ASTRAY_RAD = 0.06
"""While the setpoint moves, or has just stopped: this far outside of its span, and going on outwards. Honest
servos stay within 0.03 (see guard/README.md)."""
SHAKES_RAD = 0.15
"""A joint whose setpoint's span is wider is fast: when it brakes, it throws what hangs on it."""
SHAKEN_NS = 200 * NS_PER_MS
"""So long after that the others may swing."""
RETURN_RAD = 0.045
"""Astray until it is back within this: the span's end moves in steps."""
OUTWARD_RAD_S = 0.15
"""Slower than this a joint does not count as going outwards: it sags, or a count flickers."""
SETTLE_NS = 300 * NS_PER_MS
"""Time that a servo takes to come to rest after its setpoint has."""
STANDS_RAD = 4e-3
"""A setpoint that moves by less than this within its span all but stands: its joint is right behind."""
CREEP_RAD_S = math.radians(0.3)
"""A settled joint may sag so slowly: warmth, load. How far is bounded by the guard's other windows."""


@dataclass(frozen=True, slots=True)
class MotionPatience:
    """How long a joint that is astray may go on outwards."""

    plain_ns: int
    shaken_ns: int
    """Where others have moved fast just now, and may have thrown it."""


class UncommandedMotion:
    """Watches J joints. Give it each reading once, with the span of the setpoints of the time just gone."""

    def __init__(
        self,
        joint_names: Sequence[str],
        still_rad: float = STILL_RAD,
        *,
        readings: int = 0,
        patience: MotionPatience | None = None,
    ) -> None:
        """`still_rad`: how far a joint that has settled may be from where it settled.

        Beyond, it must go on outwards in so many `readings` in a row: an encoder that lies has only jumped.
        `patience`: how long a joint astray must go on outwards; None: one reading is enough.
        """
        self._still_rad = still_rad
        self._readings = readings
        self._patience = patience
        self._astray_ns: NDArray[np.int64] = np.full(len(joint_names), -1, np.int64)
        """Since when each joint has gone on outwards, astray; -1 where it does not."""
        self._fast_ns: NDArray[np.int64] = np.full(len(joint_names), -SHAKEN_NS, np.int64)
        """When each joint's setpoint was fast last."""
        self._outwards: NDArray[np.int64] = np.zeros(len(joint_names), np.int64)
        joints = len(joint_names)
        self._names = tuple(joint_names)
        self._settled_ns: NDArray[np.int64] = np.full(joints, -1, np.int64)
        """When each setpoint began to stand; -1 where it moves or is not known."""
        self._stands_rad: Array = np.zeros(joints)
        self._rests_rad: Array = np.full(joints, np.nan)
        """Where each joint came to rest; NaN while it has not."""
        self._before_rad: Array = np.full(joints, np.nan)
        self._before_ns = 0
        self.words: dict[str, str] = {}
        """What moved in the last reading that was judged, by joint."""

    def begin(self, now_ns: int, joints: Mask, position_rad: Array) -> None:
        """These joints (J,) stand here (J,), and have settled already: they are switched on now."""
        self._settled_ns[joints] = now_ns - SETTLE_NS
        for kept in (self._stands_rad, self._rests_rad, self._before_rad):
            np.copyto(kept, position_rad, where=joints)

    def judge(
        self,
        read_ns: int,
        span: tuple[Array, Array],
        position_rad: Array,
        heard: Mask,
        *,
        under_way: bool = False,
    ) -> Mask:
        """(J,) joints that move without a command, by a reading (J,) of those `heard`; `words` says how.

        `span` is the lowest and the highest setpoint (J,) that may still be on its way into the motors.
        `under_way`: the robot moves or may any moment, and may take up a load: none is settled.
        """
        low, high = span
        dt_s = min(max((read_ns - self._before_ns) / NS_PER_S, 0.0), 0.1)
        middle = 0.5 * (low + high)
        stands = high - low < STANDS_RAD
        if under_way or (heard & ~stands).any():
            # joints that move shake those that stand: light ones by a degree
            stands = np.zeros_like(stands)
        self._rests_rad = self._rests_rad + (middle - self._stands_rad)
        self._stands_rad = middle
        self._settled_ns = np.where(
            stands, np.where(self._settled_ns < 0, read_ns, self._settled_ns), np.int64(-1)
        )
        self._rests_rad = np.where(stands, self._rests_rad, np.nan)
        rested = stands & (np.abs(read_ns - self._settled_ns) >= SETTLE_NS) & heard
        self._rests_rad = np.where(rested & np.isnan(self._rests_rad), position_rad, self._rests_rad)
        moved = position_rad - self._rests_rad
        # comparing a NaN gives False: not at rest, or never heard
        beyond = np.maximum(low - position_rad, position_rad - high)
        off = np.where(np.isnan(moved), np.where(position_rad > high, beyond, -beyond), moved)
        outwards = np.sign(off) * (position_rad - self._before_rad) > OUTWARD_RAD_S * dt_s
        self._outwards = np.where(heard, np.where(outwards, self._outwards + 1, 0), self._outwards)
        left = (np.abs(moved) > self._still_rad) & heard & (self._outwards >= self._readings)
        self._rests_rad += np.clip(moved, -CREEP_RAD_S * dt_s, CREEP_RAD_S * dt_s)
        far = beyond > np.where(self._astray_ns < 0, ASTRAY_RAD, RETURN_RAD)
        astray = far & heard & (self._outwards >= max(1, self._readings))
        if self._patience is not None:
            astray = self._for_long(read_ns, self._patience, astray, high - low)
        np.copyto(self._before_rad, position_rad, where=heard)
        self._before_ns = read_ns
        out: Mask = left | astray
        self.words = {}
        if out.any():
            self._describe(out, left, moved, beyond)
        return out

    def _for_long(self, read_ns: int, patience: MotionPatience, astray: Mask, width: Array) -> Mask:
        """(J,) those of the joints astray that have gone on for longer than they may."""
        np.copyto(self._fast_ns, read_ns, where=width > SHAKES_RAD)
        if not astray.any():
            self._astray_ns[:] = -1
            return astray
        self._astray_ns = np.where(
            astray, np.where(self._astray_ns < 0, read_ns, self._astray_ns), np.int64(-1)
        )
        fast = np.abs(read_ns - self._fast_ns) < SHAKEN_NS
        by_others = fast.sum() - fast > 0
        allowed_ns = np.where(by_others, patience.shaken_ns, patience.plain_ns)
        long: Mask = astray & (np.abs(read_ns - self._astray_ns) >= allowed_ns)
        return long

    def _describe(self, out: Mask, left: Mask, moved: Array, beyond: Array) -> None:
        for j in np.flatnonzero(out).tolist():
            if left[j]:
                words = f"moves by itself: {abs(math.degrees(moved[j])):.1f}° away from where it was held"
            else:
                words = f"moves against its setpoint: {math.degrees(beyond[j]):.1f}° beyond where it was sent"
            self.words[self._names[j]] = words
