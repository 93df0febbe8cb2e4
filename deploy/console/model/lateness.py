"""How late the robot is: of each command that it says to have carried out, and second by second. Pure."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from statistics import median

from common.clock import NS_PER_S, to_ms, to_s
from common.latency.one_way import master_offset, one_way_ns, round_trip_ns
from common.wire.messages import Command, RobotState
from deploy.console.model.creep import CreepWatch
from deploy.console.model.values import ms

_REMEMBERED = 64
"""Commands whose sampling is remembered until the robot tells of them."""
KEPT_S = 60
"""Seconds of which a figure is kept for the page."""


@dataclass(frozen=True, slots=True)
class CommandLateness:
    """Of one command. None where it is not known."""

    sequence: int
    whole_ns: int | None
    """From the nodes' sampling to the servos' writing, on the master's clock."""
    one_way_ns: int | None
    """From put to received."""
    round_trip_ns: int | None
    """Of put and state, on the master's clock alone."""
    bound_ns: int | None
    """Half-width of the clock offset's bound."""


class LatenessLog:
    """The newest command's lateness, and the median of each of the last `KEPT_S` seconds."""

    def __init__(self) -> None:
        self.newest: CommandLateness | None = None
        self.newest_ns = 0
        """When it was told."""
        self.creep = CreepWatch()
        self._sampled: dict[tuple[int, int], int] = {}
        self._told = 0, 0, False
        """Number and put of the newest command that was told of, and whether it was written."""
        self._hears_commands = False
        self._second = 0
        self._in_second: list[tuple[float, float | None]] = []
        self._seconds: deque[tuple[int, float, float | None]] = deque(maxlen=KEPT_S)

    def on_command(self, command: Command) -> None:
        """A command left: remember when it was sampled."""
        self._hears_commands = True
        self._sampled[command.sequence, command.stamps.put_ns] = command.stamps.sampled_ns
        while len(self._sampled) > _REMEMBERED:
            self._sampled.pop(next(iter(self._sampled)))

    def on_state(self, state: RobotState, arrived_ns: int, masters_clock: bool) -> CommandLateness | None:
        """The lateness of a command that the state is the first to tell of, or to tell that it was written.

        `masters_clock`: whether `arrived_ns` is of the master's clock.
        """
        echo = state.echo
        if echo is None:
            return None
        written = echo.written_ns >= echo.received_ns
        told = echo.sequence, echo.put_ns, written
        if told == self._told:
            return None
        self._told = told
        offset = master_offset(state)
        sampled_ns = self._sampled.get((echo.sequence, echo.put_ns))
        whole = None
        if sampled_ns is not None and offset.trusted and written:
            whole = offset.remote_ns(echo.written_ns) - sampled_ns
        self.newest = CommandLateness(
            echo.sequence,
            whole,
            one_way_ns(echo.put_ns, echo.received_ns, offset),
            round_trip_ns(state, echo, arrived_ns) if masters_clock else None,
            offset.bound_ns if offset.trusted else None,
        )
        self.newest_ns = arrived_ns
        self._record(whole if self._hears_commands else self.newest.one_way_ns, self.newest, arrived_ns)
        return self.newest

    def seconds(self, now_ns: int) -> list[list[float | None]]:
        """[s before now, median ms, bound ms] of each whole second, oldest first.

        It begins with the first that is known; later ones that are not have None, so that a curve has gaps.
        """
        this = now_ns // NS_PER_S
        self._close(this)
        known = {second: (value, bound) for second, value, bound in self._seconds}
        return [
            [round(to_s(second * NS_PER_S - now_ns), 1), *known.get(second, (None, None))]
            for second in range(max(min(known, default=this), this - KEPT_S), this)
        ]

    def _record(self, late_ns: int | None, one: CommandLateness, arrived_ns: int) -> None:
        """One figure for the minute and the creep: a console that hears no commands knows the way alone.

        It never changes from the one to the other: each hold would look like less latency, and the next
        engagement like a latency that creeps.
        """
        self._close(arrived_ns // NS_PER_S)
        if late_ns is not None:
            self._in_second.append((to_ms(late_ns), ms(one.bound_ns)))

    def _close(self, second: int) -> None:
        if second == self._second:
            return
        if self._in_second:
            bounds = [bound for _, bound in self._in_second if bound is not None]
            value = round(median(value for value, _ in self._in_second), 2)
            self._seconds.append((self._second, value, max(bounds, default=None)))
            self.creep.add(self._second, value)
            self._in_second = []
        self._second = second
