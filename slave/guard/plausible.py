"""Whether each encoder shows where its joint was sent. A joint whose encoder does not is held alone, named.

A servo follows its setpoint late, and never far from where the setpoint has been. So an honest encoder is
within the span of the last setpoints, give or take a window: whatever the strategy, the network's delay or
the operator's motion, for they all come before the setpoint. An encoder that is stuck leaves that span when
the setpoint moves on, one that drifts or slips leaves it sooner or later; a drive that lags behind, or a limb
that is kept from moving, looks the same and is treated the same. An encoder that jumps farther than its joint
can turn is doubted for that alone.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from common.clock import to_ns, to_s
from common.quaternion import Array
from common.wire.messages import Mask
from slave.guard.config import GuardConfig

BUCKETS = 8
"""The past is kept as the span of the setpoint in this many pieces."""
JUMP_FACTOR = 2.0
"""Faster than this times the joint's own limit is no motion. The simulated joints reach 1.05 times it."""
JUMP_SLACK_RAD = 0.005
"""Three counts of 12 bits, for flicker."""
JUMPS = 3
"""A single bad reading jumps there and back, and is forgiven."""
FORGIVEN = 0.25
"""Doubt fades at this share of the rate at which it grows."""
LONGEST_S = 0.025
"""More time than this between two readings does not count for more."""


class Past:
    """The span of the setpoint (J,) over the time just gone, in pieces: as cheap at any rate."""

    def __init__(self, joints: int, length_ns: int) -> None:
        self._piece_ns = max(1, length_ns // BUCKETS)
        self._length_ns = length_ns
        # two pieces more than the length: the one under way, and the one in which the span begins
        self._low, self._high = np.zeros((2, BUCKETS + 2, joints))
        self._until_ns: NDArray[np.int64] = np.zeros(BUCKETS + 2, np.int64)
        self._newest = 0
        self._began_ns = 0

    def restart(self, now_ns: int, setpoint_rad: Array) -> None:
        """Forget what was: the setpoint has always stood here."""
        self._low[:] = self._high[:] = setpoint_rad
        self._until_ns[:] = now_ns
        self._newest, self._began_ns = 0, now_ns

    def add(self, now_ns: int, setpoint_rad: Array) -> None:
        """Note where the setpoint is from now on."""
        if now_ns - self._began_ns >= self._piece_ns:
            # it stood where it was until now, however long that is
            before = self._newest
            self._until_ns[before] = now_ns
            self._newest = (before + 1) % len(self._low)
            self._low[self._newest] = self._high[self._newest] = setpoint_rad
            self._began_ns = now_ns
        i = self._newest
        np.minimum(self._low[i], setpoint_rad, out=self._low[i])
        np.maximum(self._high[i], setpoint_rad, out=self._high[i])
        self._until_ns[i] = now_ns

    def span(self, at_ns: int) -> tuple[Array, Array]:
        """Lowest and highest (J,) since `length_ns` before a time."""
        seen = self._until_ns >= at_ns - self._length_ns
        seen[self._newest] = True
        low: Array = self._low[seen].min(axis=0)
        high: Array = self._high[seen].max(axis=0)
        return low, high


class EncoderPlausibility:
    """The doubted encoders, until they agree again and an operator engages anew."""

    def __init__(self, joint_names: Sequence[str], fastest_rad_s: Array, config: GuardConfig) -> None:
        """`fastest_rad_s` (J,) is what the joints can do, not what they may."""
        joints = len(joint_names)
        self._names = tuple(joint_names)
        self._window_rad = config.follow_window_rad
        self._patience_s = config.follow_patience_s
        self._most = config.max_doubted_joints
        self._lag_ns = to_ns(config.follow_lag_s)
        self._fastest_rad_s = JUMP_FACTOR * fastest_rad_s
        self._past = Past(joints, self._lag_ns)
        self._stepped_ns: int | None = None
        self._read_ns = 0
        self._heard: Mask = np.zeros(joints, np.bool_)
        self._heard_ns: NDArray[np.int64] = np.zeros(joints, np.int64)
        self._heard_rad: Array = np.zeros(joints)
        self._score_s: Array = np.zeros(joints)
        self._calm = True
        self.span: tuple[Array, Array] | None = None
        """Lowest and highest setpoint (J,) that the newest reading was judged by; None: it was not judged."""
        self.doubted: Mask = np.zeros(joints, np.bool_)
        """(J,) read-only."""
        self.words: dict[str, str] = {}
        """Why, by joint."""

    def note(self, now_ns: int, setpoint_rad: Array) -> None:
        """Take the setpoint (J,) that is written now."""
        before_ns, self._stepped_ns = self._stepped_ns, now_ns
        # after its own clock went back it is unknown when the setpoint was where
        if before_ns is None or now_ns < before_ns:
            self._past.restart(now_ns, setpoint_rad)
            self._heard[:] = False
        else:
            self._past.add(now_ns, setpoint_rad)

    def judge(self, position_rad: Array, valid: Mask, read_ns: int, moving: bool) -> list[str]:
        """Take a reading (J,). The joints that are doubted from now on; new ones only while `moving`.

        The same reading twice counts once, and one that is older than the lag is left to the encoders' watch.
        """
        stale = self._stepped_ns is None or self._stepped_ns - read_ns > self._lag_ns
        self.span = None
        if stale or read_ns == self._read_ns:
            return []
        dt_s = min(max(to_s(read_ns - self._read_ns), 0.0), LONGEST_S)
        self._read_ns = read_ns
        good = valid & np.isfinite(position_rad)
        low, high = self.span = self._past.span(read_ns)
        # not ahead and not behind, by more than the window; a NaN compares False and is not good anyway
        astray = (np.maximum(low - position_rad, position_rad - high) > self._window_rad) & good
        jumped = self._jumps(position_rad, good, read_ns)
        if self._calm and not astray.any() and not jumped.any():
            return []
        self._score_s += np.where(astray, dt_s, np.where(good, -FORGIVEN * dt_s, 0.0))
        self._score_s += np.where(jumped, self._patience_s / JUMPS, 0.0)
        np.clip(self._score_s, 0.0, self._patience_s, out=self._score_s)
        self._calm = not self._score_s.any()
        if not moving:
            return []
        # rounding must not ask for one more
        fresh = (self._score_s >= self._patience_s - 1e-9) & ~self.doubted
        return self._doubt(fresh, position_rad, low, high, jumped) if fresh.any() else []

    def _jumps(self, position_rad: Array, good: Mask, read_ns: int) -> Mask:
        since_s = (read_ns - self._heard_ns) * 1e-9
        way = np.abs(position_rad - self._heard_rad)
        jumped: Mask = (way > self._fastest_rad_s * since_s + JUMP_SLACK_RAD) & good & self._heard
        np.copyto(self._heard_rad, position_rad, where=good)
        np.copyto(self._heard_ns, read_ns, where=good)
        self._heard |= good
        return jumped

    def _doubt(self, fresh: Mask, position_rad: Array, low: Array, high: Array, jumped: Mask) -> list[str]:
        self.doubted = self.doubted | fresh
        for j in np.flatnonzero(fresh).tolist():
            off = max(low[j] - position_rad[j], position_rad[j] - high[j])
            if jumped[j]:
                words = "the encoder jumps farther than the joint can turn"
            else:
                words = f"the encoder is {off:.2f} rad from where the joint was sent"
            self.words[self._names[j]] = words
        return [self._names[j] for j in np.flatnonzero(fresh).tolist()]

    def too_many(self) -> str | None:
        """Why the whole robot is to be held, or None."""
        if len(self.words) <= self._most:
            return None
        return f"{len(self.words)} encoders do not agree with the setpoint: {', '.join(self.words)}"

    def unsettled(self) -> str | None:
        """A text for the first doubted joint whose encoder has not agreed for long enough, or None."""
        for joint in self.words:
            if self._score_s[self._names.index(joint)] > 0.0:
                return f"{joint}: {self.words[joint]}; it must agree for a while before it may move"
        return None

    def trust(self) -> None:
        """Doubt no encoder any more: an operator engages, and no joint is unsettled."""
        self.doubted = np.zeros_like(self.doubted)
        self.words.clear()
