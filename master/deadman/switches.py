"""Opens the switches that the master's file names, and hands the suit's frames to them."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from pathlib import Path

from common.clock import Clock, monotonic_ns
from common.inputs.config import KeyConfig
from common.inputs.key_state import KeyState
from common.inputs.keys import InputKeys
from common.log.throttle import LogThrottle
from master.deadman.can_button import CanButtonState, load_button
from master.deadman.config import CanButton, ConsoleHold, Pedal, SwitchConfig
from master.deadman.grip import Grip, OperatorGrip, SwitchState
from master.deadman.held_elsewhere import HeldElsewhere
from master.deadman.hold_socket import HoldSocket

ZERO_POSE = "zero pose"
log = logging.getLogger(__name__)


class Switches:
    """The operator's deadman and clutch. Raises ConfigError, InputError or ModuleNotFoundError."""

    def __init__(
        self,
        deadman: SwitchConfig,
        clutch: SwitchConfig | None,
        dbc: Path,
        taken: Mapping[tuple[str, int], str],
        zero_pose: KeyConfig | None = None,
        clock: Clock = monotonic_ns,
    ) -> None:
        """`taken`: what the identifiers of other frames are, by bus and identifier.

        `zero_pose`: a key that the operator presses for another reason, often of the same device.
        """
        configs = {"deadman": deadman} | ({} if clutch is None else {"clutch": clutch})
        pedals = {name: config for name, config in configs.items() if isinstance(config, Pedal)}
        others = {} if zero_pose is None else {ZERO_POSE: zero_pose}
        self._keys = InputKeys({**pedals, **others}, clock=clock)
        self._buttons: dict[str, CanButtonState] = {
            name: load_button(config, dbc, taken, f"operator.{name}")
            for name, config in configs.items()
            if isinstance(config, CanButton)
        }
        self._held: dict[str, HoldSocket] = {
            name: HoldSocket(config.socket, HeldElsewhere(config.timeout_s), clock)
            for name, config in configs.items()
            if isinstance(config, ConsoleHold)
        }
        found: dict[str, SwitchState] = {**self._keys.states, **self._buttons}
        found |= {name: each.held for name, each in self._held.items()}
        self._grip = OperatorGrip(found.get("deadman"), found.get("clutch"))
        self._on_end: Callable[[Grip], None] = lambda _: None
        self._on_zero_pose: Callable[[KeyState], None] = lambda _: None
        self._clock = clock
        self._said: dict[str, str] = {}
        self._throttle = LogThrottle()

    def start(self, on_end: Callable[[Grip], None], on_zero_pose: Callable[[KeyState], None]) -> None:
        """Begin to read. `on_end` is called when the grip ends that the last command told.

        `on_zero_pose` is called with that key whenever something may have changed.
        """
        self._on_end, self._on_zero_pose = on_end, on_zero_pose
        self._keys.start(self._changed)
        for each in self._held.values():
            each.open(self._changed)

    def close(self) -> None:
        """Let go of the devices."""
        self._keys.close()
        for each in self._held.values():
            each.close()

    @property
    def buses(self) -> frozenset[str]:
        """Buses that carry a button's frames."""
        return frozenset(button.bus for button in self._buttons.values())

    def frame(self, bus: str, frame_id: int, data: bytes, now_ns: int) -> bool:
        """Take a frame of a bus; False where it is none of a button."""
        if not self._buttons:
            return False
        took = [button.frame(bus, frame_id, data, now_ns) for button in self._buttons.values()]
        if any(took):
            self._changed()
        return any(took)

    def bus_down(self, bus: str) -> None:
        """A bus has failed."""
        for button in self._buttons.values():
            button.bus_down(bus)
        self._changed()

    def take(self) -> Grip:
        """The grip for the command that is made now, by what has come until now."""
        self._keys.poll()
        for each in self._held.values():
            each.poll()
        grip = self._grip.take(self._clock())
        self._look_beside()
        return grip

    @property
    def words(self) -> dict[str, str]:
        """Each switch in words."""
        return self._grip.words

    def _changed(self) -> None:
        grip = self._grip.ended(self._clock())
        if grip is not None:
            self._on_end(grip)
        self._look_beside()

    def _look_beside(self) -> None:
        if ZERO_POSE in self._keys.states:
            self._on_zero_pose(self._keys.states[ZERO_POSE])
        now = self._grip.words
        for name, words in now.items():
            if words != self._said.get(name) and self._throttle.passes(self._clock(), (name, words)):
                log.info("%s: %s", name, words)
        self._said = now
