"""What the master knows of the robot from its state messages: silence, latency on one clock. Pure."""

from __future__ import annotations

from common.clock import to_ns
from common.latency.arrivals import Arrivals
from common.latency.durations import StreamedDurations
from common.latency.one_way import round_trip_ns
from common.wire.messages import SaidOfRobot
from common.wire.topics import STATE


class RobotWatch:
    """The newest state, whether the robot has fallen silent, and round-trip times."""

    def __init__(self) -> None:
        self.state: SaidOfRobot | None = None
        self.round_trip = StreamedDurations()
        self.arrivals = Arrivals()
        """Of the states, by their numbers; a robot that starts anew begins its count anew."""
        self._heard_ns = 0
        self._echoed = 0
        self._was_silent = True
        self.times_lost = 0

    def on_state(self, state: SaidOfRobot, arrived_ns: int, ours: bool = True) -> None:
        """Take a state message; each command's echo closes one round trip.

        `ours`: whether this master holds the lease. Else the echoes are of another's commands.
        """
        self.state = state
        self.arrivals.note(state.instance, state.sequence)
        self._heard_ns = arrived_ns
        echo = state.echo
        if ours and echo is not None and echo.sequence != self._echoed:
            self._echoed = echo.sequence
            self.round_trip.record(round_trip_ns(state, echo, arrived_ns))

    def silent(self, now_ns: int, for_s: float = STATE.timeout_s) -> bool:
        """Whether the robot has not been heard for so long, by default the state topic's time-out."""
        return self.state is None or now_ns - self._heard_ns > to_ns(for_s)

    def change(self, now_ns: int) -> str | None:
        """A line for the log when the robot falls silent or is heard again."""
        silent = self.silent(now_ns)
        if silent == self._was_silent:
            return None
        self._was_silent = silent
        if silent:
            self.times_lost += 1
            return f"the robot is silent for more than {STATE.timeout_s:g} s: it holds by itself"
        return "the robot is heard"
