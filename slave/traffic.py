"""What became of the commands of the lease's holder: which came, how late, which stages each passed. Pure."""

from __future__ import annotations

from common.clock import to_ns
from common.clock_sync import Offset
from common.latency.arrivals import Arrivals
from common.latency.durations import StreamedDurations
from common.latency.one_way import one_way_ns
from common.wire.messages import Command
from slave.command_rate import WantedRate
from slave.due import DueCommands
from slave.journey import Journeys


class CommandTraffic:
    """Counters and times of one holder's commands after the other's."""

    def __init__(self) -> None:
        self.arrivals = Arrivals()
        """The arrivals, counted by the commands' numbers."""
        self.one_way = StreamedDurations()
        """From put to received, while the offset was trusted."""
        self.due = DueCommands()
        """The same with the commands that were due and did not come."""
        self.journeys = Journeys()
        """From the master's sample to the encoder that moved."""
        self.rate = WantedRate()
        """The rate at which commands are wanted."""
        self._master_clock = 0

    def received(self, command: Command, received_ns: int, offset: Offset) -> None:
        """Note a command of the lease's holder, whether the gates accept it or not."""
        self.arrivals.note(command.lease, command.sequence)
        put_ns = command.stamps.put_ns
        transit_ns = one_way_ns(put_ns, received_ns, offset)
        if transit_ns is not None:
            self.one_way.record(transit_ns)
        self.due.note(
            self._master_clock, command.sequence, put_ns, transit_ns, to_ns(1e-3 * command.period_ms)
        )
        self.rate.note(command, received_ns, offset)

    def claimed(self, master_clock: int) -> None:
        """A master claimed the robot: its commands come from now on, stamped by this clock."""
        self._master_clock = master_clock
        self.rate.begin()
        self.journeys.forget()

    def released(self) -> None:
        """The master gave the robot back: until it claims it again nothing is due."""
        self.due.forget()
