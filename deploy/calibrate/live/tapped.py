"""The suit of a master that runs: its raw sweeps from the tap, so that a calibration needs no bus of its own.

Two pollers on one bus would disturb each other. The master goes on polling, and its tap has every frame with
its time; decoded by the same code as at the bus, they give the same sweeps.
"""

from __future__ import annotations

from pathlib import Path

from common.can.frame import CanFrame
from common.tap.reader import TapReader
from master.capture.polling import OnSweep
from master.capture.source import SuitSource
from master.journal.calls import FRAMES, apply, decode_calls


class TappedSuit:
    """Makes sweeps of a master's recorded calls. Pure."""

    def __init__(self, source: SuitSource, on_sweep: OnSweep) -> None:
        self._source = source
        self._on_sweep = on_sweep
        self._open = False

    def take(self, payload: bytes) -> None:
        """One message of `suit/frames`. Raises RecordingError."""
        for call in decode_calls(payload):
            apply(call, self)

    def tick(self, tick: int, now_ns: int) -> tuple[CanFrame, None]:
        """Open a tick; ends the one before where it was left open, or where a message was missed."""
        if self._open:
            self.close(now_ns)
        self._open = True
        sync = self._source.open_window(tick, now_ns)
        if not self._source.waits:
            self.close(now_ns)
        return sync, None

    def frame(self, bus: str, frame_id: int, data: bytes, now_ns: int) -> bool:
        """Take one frame."""
        return self._source.on_frame(bus, frame_id, data, now_ns) and self._open

    def frames(self, bus: str, frames: list[tuple[int, bytes, int]]) -> None:
        """Take frames of a bus of which none is awaited."""
        self._source.on_frames(bus, frames)

    def close(self, now_ns: int) -> None:
        """End the tick."""
        if self._open:
            self._open = False
            self._on_sweep(self._source.close_window(now_ns))

    def bus_down(self, bus: str) -> None:
        """Count the nodes of a failed bus as lost."""
        self._source.bus_down(bus)

    def set_decimation(self, ticks: int) -> None:
        """How often the master decides changes no reading."""

    def ask_zero_pose(self, by: str, now_ns: int) -> None:
        """What the master does with the operator's wish changes no reading."""


async def hear_suit(tap: Path, suit: TappedSuit) -> None:
    """Read a master's tap until cancelled. Raises TandemError where there is none, or it ended."""
    with TapReader(tap, [FRAMES]) as reader:
        while True:
            message = await reader.read()
            if message.topic == FRAMES:
                suit.take(message.payload)
