"""Several keys by the names of what they are for, each device opened once."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from common.clock import Clock, monotonic_ns
from common.inputs.config import KeyConfig
from common.inputs.device import Opener, open_input
from common.inputs.key_state import KeyState
from common.inputs.reader import InputReader


class InputKeys:
    """The keys that a file names, such as the deadman's and the clutch's: often two of one pedal.

    Raises InputError for a key that no kernel has, ModuleNotFoundError without the extra `input`.
    """

    def __init__(
        self, keys: Mapping[str, KeyConfig], opener: Opener = open_input, clock: Clock = monotonic_ns
    ) -> None:
        devices: dict[str, list[KeyConfig]] = {}
        for key in keys.values():
            devices.setdefault(key.device, []).append(key)
        self._readers = {
            device: InputReader(
                device,
                {key.key: key.repeat_timeout_s for key in of_it},
                grab=any(key.grab for key in of_it),
                opener=opener,
                clock=clock,
            )
            for device, of_it in devices.items()
        }
        self.states: dict[str, KeyState] = {
            name: self._readers[key.device].keys[key.key] for name, key in keys.items()
        }
        """By what they are for."""

    def start(self, on_change: Callable[[], None]) -> None:
        """Open the devices, or look for them until they are there. Needs a running event loop."""
        for reader in self._readers.values():
            reader.on_change = on_change
            reader.start()

    def poll(self) -> None:
        """Take what has come by now. Before each use."""
        for reader in self._readers.values():
            reader.poll()

    def close(self) -> None:
        """Let go of the devices. Safe to call twice."""
        for reader in self._readers.values():
            reader.close()
