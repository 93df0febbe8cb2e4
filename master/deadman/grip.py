"""What the operator holds: the deadman, and the clutch if there is one. Pure.

All commanded robots get the same grip. One that ends is told at once, and not with the next command.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from common.inputs.held import HeldSwitch


class SwitchState(Protocol):
    """What a source says of its switch: a key, a button on CAN."""

    @property
    def releases(self) -> int:
        """How often it went up so far."""

    @property
    def words(self) -> str:
        """Why it is not known."""

    def at(self, now_ns: int) -> bool | None:
        """Whether it is down; None while nobody can know."""


@dataclass(frozen=True, slots=True)
class Grip:
    """What a command says of the operator's hold."""

    deadman_held: bool
    clutch_out: bool = False


class OperatorGrip:
    """Looks at the switches whenever a command is made, and whenever one of them changes."""

    def __init__(self, deadman: SwitchState | None, clutch: SwitchState | None = None) -> None:
        """`deadman` None: always held. `clutch` None: the operator has none."""
        self._switches = {name: s for name, s in (("deadman", deadman), ("clutch", clutch)) if s is not None}
        self._held = {name: HeldSwitch() for name in self._switches}
        self._sent = Grip(False)

    def take(self, now_ns: int) -> Grip:
        """The grip for the command that is made now."""
        self._sent = self._look(now_ns)
        return self._sent

    def ended(self, now_ns: int) -> Grip | None:
        """The grip to tell at once, where the last command said that it was held and it is no more."""
        grip = self._look(now_ns)
        let_go = self._sent.deadman_held and not grip.deadman_held
        clutched_out = grip.clutch_out and not self._sent.clutch_out
        if not (let_go or clutched_out):
            return None
        self._sent = grip
        return grip

    @property
    def words(self) -> dict[str, str]:
        """Each switch in words, by its name; `held` where it is."""
        return {name: held.words or "held" for name, held in self._held.items()} or {"deadman": "always held"}

    def _look(self, now_ns: int) -> Grip:
        down = {
            name: self._held[name].take(switch.at(now_ns), switch.releases, switch.words)
            for name, switch in self._switches.items()
        }
        return Grip(down.get("deadman", True), not down.get("clutch", True))
