"""A button at the robot by which somebody asks for an operator."""

from __future__ import annotations

from collections.abc import Callable

from common.clock import Clock, monotonic_ns
from common.inputs.config import KeyConfig
from common.inputs.device import Opener, open_input
from common.inputs.pressed import PressedKey
from common.inputs.reader import InputReader


class CallButton:
    """Calls `on_press` on the loop for each new press. A device that is not there is looked for again."""

    def __init__(
        self,
        config: KeyConfig,
        on_press: Callable[[], None],
        opener: Opener = open_input,
        clock: Clock = monotonic_ns,
    ) -> None:
        """Raises InputError for a key that no kernel has."""
        self._reader = InputReader(
            config.device, {config.key: config.repeat_timeout_s}, grab=config.grab, opener=opener, clock=clock
        )
        self._reader.on_change = self._look
        self._key = self._reader.keys[config.key]
        self._pressed = PressedKey()
        self._on_press = on_press

    def __enter__(self) -> CallButton:
        """Open the device. Needs a running event loop."""
        self._reader.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Let go of the device."""
        self._reader.close()

    def _look(self) -> None:
        if self._pressed.take(self._key.down, self._key.presses):
            self._on_press()
