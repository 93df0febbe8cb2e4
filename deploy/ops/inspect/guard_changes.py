"""Each change of the guard in a recording, with the seconds around it. Pure."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

import numpy as np

from common.clock import to_ns, to_s
from common.errors import CodecError
from common.quaternion import Array
from common.recording import Entry
from common.wire.codec import decode
from common.wire.messages import RobotState
from slave.tap import GUARD, TICK, decode_guard, decode_tick

AROUND_S = 3.0
"""Before and after an event."""
STEP_S = 0.018
"""Between two rows that are kept: ticks of 200 Hz are thinned to the 50 Hz of states."""
MOST_EVENTS = 1000
"""Kept with the seconds around them; more are counted."""


@dataclass(frozen=True, slots=True)
class Moment:
    """The robot at one instant."""

    at_ns: int
    """Time of day."""
    setpoint_rad: Array
    position_rad: Array


@dataclass(slots=True)
class GuardChange:
    """One change of state or reason."""

    at_ns: int
    """Time of day, ns since 1970."""
    at_s: float
    """Since the recording began."""
    before: str
    """The state before; empty where the recording begins."""
    state: str
    reason: str
    robot: str = ""
    """Its name; empty in a slave's own recording."""
    commands: int = 0
    """In the seconds before."""
    silence_s: float = 0.0
    """The longest time without a command in the seconds before, up to the event."""
    off_deg: float = 0.0
    """The largest distance between setpoint and encoder in the seconds around."""
    off_joint: str = ""
    moments: list[Moment] = field(default_factory=list)
    """The seconds around, one row each 20 ms."""

    def tree(self) -> dict[str, object]:
        """Plain values for JSON, without the rows."""
        names = (
            "at_ns",
            "at_s",
            "before",
            "state",
            "reason",
            "robot",
            "commands",
            "silence_s",
            "off_deg",
            "off_joint",
        )
        return {name: getattr(self, name) for name in names}


class GuardChanges:
    """Takes one robot's messages in order; `found` are the events, complete once all have been taken."""

    def __init__(self, joints: tuple[str, ...], began: Entry, robot: str = "") -> None:
        """`began`: the first message of the recording, whichever robot it is of."""
        self._robot = robot
        # the time of day may be set while it is recorded: it is read once, and the monotonic clock counts on
        self._day_less_ns = began.wall_ns - began.monotonic_ns
        self._began_ns = began.wall_ns
        self.found: list[GuardChange] = []
        self.more = 0
        """Events beyond those kept."""
        self._joints = joints
        self._known: tuple[str, str] = "", ""
        self._tapped = False
        self._recent: deque[Moment] = deque()
        self._commands: deque[int] = deque()
        self._open: list[GuardChange] = []

    def take(self, entry: Entry) -> None:
        """One message. States of another profile are left out."""
        at_ns = entry.monotonic_ns + self._day_less_ns
        name = entry.topic.rpartition("/")[2]
        if entry.topic == GUARD:
            self._tapped = True
            _, state, reason = decode_guard(entry.payload)
            self._changed(at_ns, state, reason)
        elif entry.topic == TICK:
            tick = decode_tick(entry.payload)
            self._moment(at_ns, tick.setpoint_rad, tick.position_rad)
        elif name == "command":
            self._commands.append(at_ns)
        elif name == "state" and not self._tapped:
            try:
                state_ = decode(entry.payload, RobotState, len(self._joints))
            except CodecError:
                return
            self._changed(at_ns, state_.guard, state_.reason)
            self._moment(at_ns, state_.setpoint_rad, state_.position_rad)

    def end(self) -> None:
        """The recording ends: what is open is complete."""
        for event in self._open:
            self._finish(event)
        self._open.clear()

    def _moment(self, at_ns: int, setpoint_rad: Array, position_rad: Array) -> None:
        if self._recent and at_ns - self._recent[-1].at_ns < to_ns(STEP_S):
            return
        moment = Moment(at_ns, setpoint_rad, position_rad)
        self._recent.append(moment)
        while at_ns - self._recent[0].at_ns > to_ns(AROUND_S):
            self._recent.popleft()
        while self._commands and at_ns - self._commands[0] > to_ns(AROUND_S):
            self._commands.popleft()
        for event in list(self._open):
            event.moments.append(moment)
            if at_ns - event.at_ns > to_ns(AROUND_S):
                self._finish(event)
                self._open.remove(event)

    def _changed(self, at_ns: int, state: str, reason: str) -> None:
        if (state, reason) == self._known:
            return
        (before, _), self._known = self._known, (state, reason)
        if len(self.found) >= MOST_EVENTS:
            self.more += 1
            return
        event = GuardChange(at_ns, to_s(at_ns - self._began_ns), before, state, reason, self._robot)
        recent = [at for at in self._commands if at_ns - at <= to_ns(AROUND_S)]
        event.commands = len(recent)
        if recent:
            event.silence_s = to_s(int(np.diff([*recent, at_ns]).max()))
        event.moments = list(self._recent)
        self.found.append(event)
        self._open.append(event)

    def _finish(self, event: GuardChange) -> None:
        if not event.moments:
            return
        off = np.abs([m.setpoint_rad - m.position_rad for m in event.moments])
        if off.shape[1] == len(self._joints):
            joint = int(off.max(axis=0).argmax())
            event.off_deg, event.off_joint = float(np.degrees(off.max())), self._joints[joint]
