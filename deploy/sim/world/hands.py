"""The operator's hands and feet in the virtual world: what he holds, and how the master sees it."""

from __future__ import annotations

from common.inputs.key_state import DOWN, UP, KeyState
from deploy.sim.suit.buttons import Buttons
from master.config import MasterConfig
from master.deadman.can_button import load_button
from master.deadman.config import CanButton, Pedal
from master.deadman.grip import OperatorGrip, SwitchState


class OperatorHands:
    """Deadman and clutch of the master's file, each held from the beginning."""

    def __init__(self, config: MasterConfig) -> None:
        named = {"deadman": config.operator.deadman, "clutch": config.operator.clutch}
        self.keys = {name: KeyState(name) for name, switch in named.items() if isinstance(switch, Pedal)}
        """The keys of pedals; an event is what evdev would have read."""
        self.buttons = {
            name: load_button(switch, config.capture.dbc, {}, f"operator.{name}")
            for name, switch in named.items()
            if isinstance(switch, CanButton)
        }
        """What the master heard of buttons on CAN."""
        found: dict[str, SwitchState] = {**self.keys, **self.buttons}
        self.grip = OperatorGrip(found.get("deadman"), found.get("clutch"))
        self.frozen = False
        """Whether the buttons' node hangs, and its controller repeats the last frame."""
        self._node = Buttons(config.capture.dbc)
        self._frame = self._node.frame()
        for key in self.keys.values():
            key.read(False, 0)
            self.grip.take(0)
            key.event(DOWN, 0)

    def press(self, name: str, now_ns: int) -> None:
        """He presses a pedal or a button."""
        if name in self.keys:
            self.keys[name].event(DOWN, now_ns)
        self._node.pressed.add(name.upper())

    def let_go(self, name: str, now_ns: int) -> None:
        """He lets it go."""
        if name in self.keys:
            self.keys[name].event(UP, now_ns)
        self._node.pressed.discard(name.upper())

    def send_buttons(self, now_ns: int) -> None:
        """The frame of the buttons reaches the master; the first shows them released."""
        if not self.frozen:
            self._frame = self._node.frame()
        frame = self._frame
        for button in self.buttons.values():
            button.frame(button.bus, frame.id, frame.data, now_ns)

    def bus_down(self) -> None:
        """The bus of the buttons has failed."""
        for button in self.buttons.values():
            button.bus_down(button.bus)
