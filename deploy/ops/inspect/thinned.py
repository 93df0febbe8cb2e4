"""A robot's joints over a recording of any length, in bounded memory."""

from __future__ import annotations

from common.clock import to_s
from common.errors import CodecError
from common.quaternion import Array
from common.recording import Entry
from common.skeleton import Skeleton
from common.wire.codec import decode
from common.wire.messages import RobotState
from slave.tap import TICK, decode_tick

MOST = 8000
"""Rows kept: more than a picture has pixels."""


class ThinnedJoints:
    """Takes states and ticks; keeps at most 8000 of them, evenly spread. Of several robots the first."""

    def __init__(self, skeleton: Skeleton) -> None:
        self._joints = len(skeleton.joints)
        self.time_s: list[float] = []
        """Since the first message of the recording."""
        self.position_rad: list[Array] = []
        self.setpoint_rad: list[Array] = []
        self._began_ns: int | None = None
        self.read = self.other = 0
        """States with the profile's joints, and with others."""
        self._every = 1
        self._seen = 0
        self._ticked = False
        self._states = ""
        """The topic of the first robot's states."""

    def take(self, entry: Entry) -> None:
        """One message; states of another profile are left out."""
        if self._began_ns is None:
            self._began_ns = entry.monotonic_ns
        if entry.topic == TICK:
            self._ticked = True
        elif self._ticked or not entry.topic.endswith("/state"):
            return
        else:
            self._states = self._states or entry.topic
            if entry.topic != self._states:
                return
        self._seen += 1
        if self._seen % self._every:
            return
        try:
            angles = self._angles(entry)
        except CodecError:
            self.other += 1
            return
        self.read += 1
        self.time_s.append(to_s(entry.monotonic_ns - self._began_ns))
        self.position_rad.append(angles[0])
        self.setpoint_rad.append(angles[1])
        if len(self.time_s) > MOST:
            self._every *= 2
            for rows in (self.time_s, self.position_rad, self.setpoint_rad):
                del rows[::2]

    def _angles(self, entry: Entry) -> tuple[Array, Array]:
        if entry.topic == TICK:
            tick = decode_tick(entry.payload)
            return tick.position_rad, tick.setpoint_rad
        state = decode(entry.payload, RobotState, self._joints)
        return state.position_rad, state.setpoint_rad
