"""A key of a Linux input device as an emergency stop input: it is down while the contact is closed.

A button box, a gamepad or a pedal is a keyboard to Linux. What holds its key down must be the closed contact:
with the usual USB button, whose key goes down as it is pressed, write `normally_closed = false`; an unplugged
device is a stop in either case, a broken wire inside of it is not.
"""

from __future__ import annotations

from common.clock import Clock, monotonic_ns
from common.inputs.device import Opener, open_input
from common.inputs.reader import InputReader
from slave.stop_inputs.config import StopInputConfig
from slave.stop_inputs.source import Level


class DeviceStop:
    """A `StopSource`. It needs a running event loop, on which a lost device is opened again."""

    def __init__(
        self, config: StopInputConfig, opener: Opener = open_input, clock: Clock = monotonic_ns
    ) -> None:
        """Raises InputError for a key that no kernel has."""
        # no time-out of repeats: the kernel tells at every tick which keys are down
        self._reader = InputReader(config.device, {config.key: None}, opener=opener, clock=clock)
        self._key = self._reader.keys[config.key]
        self._clock = clock
        self._moves = 0
        self._changed_ns = 0

    def start(self) -> None:
        """Open the device, or look for it until it is there."""
        self._reader.start()
        self._moves = self._key.presses + self._key.releases

    def read(self) -> Level:
        """What the device says now: its events first, then which keys are down."""
        self._reader.poll()
        now_ns = self._clock()
        moves = self._key.presses + self._key.releases
        if moves != self._moves:
            self._moves, self._changed_ns = moves, now_ns
        return Level(now_ns, self._key.down, self._key.words, self._changed_ns)

    def stop(self) -> None:
        """Let go of the device."""
        self._reader.close()
