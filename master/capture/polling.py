"""Polls the suit and hands every tick's raw readings on: what the master does, without what it does next."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from common.can.bus import CanBus
from common.can.config import BusConfig
from common.clock import monotonic_ns
from common.metrics.tree import to_tree
from common.process.pacing import TickGrid
from common.process.ticker import ticks
from master.capture.source import SuitSource, with_extended
from master.suit.sweep import Sweep

OnSweep = Callable[[Sweep], None]


@dataclass(slots=True)
class CaptureCounters:
    """Ticks since the start."""

    expected: int = 0
    missed: int = 0


class SuitCapture:
    """The polling of one suit."""

    def __init__(
        self,
        source: SuitSource,
        buses: Sequence[BusConfig],
        rate_hz: float,
        on_sweep: OnSweep,
    ) -> None:
        """`source`: the suit, whose rows are those of the sweeps."""
        self.counters = CaptureCounters()
        self.source = self._poll = source
        self._period_ns = round(1e9 / rate_hz)
        self._on_sweep = on_sweep
        extended = with_extended(source.identifiers)
        free_running = source.buses_with_nodes - source.sync_buses
        self._buses = [
            CanBus(
                bus,
                self._on_frame,
                self._on_bus,
                take_extended=bus.name in extended,
                in_batches=bus.name in free_running,
                on_frames=source.on_frames if bus.name in free_running else None,
            )
            for bus in buses
        ]
        self._open = False

    async def run(self) -> None:
        """Poll until cancelled. Raises BusError where a bus cannot be opened."""
        try:
            for bus in self._buses:
                bus.open()
            async for due in ticks(TickGrid(monotonic_ns() + self._period_ns, self._period_ns)):
                self.counters.expected += 1 + due.missed
                self.counters.missed += due.missed
                for bus in self._buses:
                    bus.read()
                if self._open:
                    self._close()
                sync = self._poll.open_window(due.tick, monotonic_ns())
                self._open = True
                for bus in self._buses:
                    if bus.name in self._poll.sync_buses:
                        bus.send(sync)
                if not self._poll.waits:
                    self._close()
        finally:
            for bus in self._buses:
                await bus.close()

    def summary(self) -> Mapping[str, object]:
        """Ticks, nodes and buses, as plain values."""
        return {
            "ticks": {"expected": self.counters.expected, "missed": self.counters.missed},
            "nodes": self._poll.summary(),
            "buses": {bus.name: to_tree(bus.metrics()) for bus in self._buses},
        }

    def _on_frame(self, bus: str, frame_id: int, data: bytes, now_ns: int) -> None:
        if self._poll.on_frame(bus, frame_id, data, now_ns) and self._open:
            self._close()

    def _on_bus(self, bus: str, up: bool) -> None:
        if not up:
            self._poll.bus_down(bus)

    def _close(self) -> None:
        self._open = False
        self._on_sweep(self._poll.close_window(monotonic_ns()))
