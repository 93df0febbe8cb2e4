"""What is wrong with each drive, in words: a second master, its bus, the drive itself. Pure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType

from slave.servos.canopen.drive import DriveState, Phase
from slave.servos.canopen.wiring import DriveWiring


class FaultWords:
    """The faults of all J drives, by joint."""

    def __init__(self, drives: Sequence[DriveState], wiring: DriveWiring) -> None:
        self._drives, self._wiring = drives, wiring
        self._down: dict[str, str] = {}
        """Why each bus that has failed did, by name."""
        self._words: dict[str, str] = {}
        self.by_joint: Mapping[str, str] = MappingProxyType({})
        """Replaced, never changed."""

    def on_bus(self, bus: str, down: str) -> None:
        """A bus has failed, for the reason `down`, or works again: an empty reason."""
        if down:
            self._down[bus] = down
        else:
            self._down.pop(bus, None)

    def update(self, second_master: str) -> bool:
        """Compose each joint's text again, and return whether any text has changed.

        `second_master`: the text about a second master on the buses; empty if there is none.
        """
        words = {}
        for name, (bus, _), drive in zip(self._wiring.joints, self._wiring.where, self._drives, strict=True):
            down = f"bus {bus} is down: {self._down[bus]}" if bus in self._down else ""
            if wrong := "; ".join(filter(None, [down, second_master, drive.words])):
                words[name] = wrong
        if words == self._words:
            return False
        self._words = words
        self.by_joint = MappingProxyType(words)
        return True

    @property
    def not_running(self) -> dict[str, str]:
        """Drives that do not run, with node, bus and reason, by joint: those that have failed first."""
        rows = zip(self._wiring.joints, self._wiring.where, self._drives, strict=True)
        waiting = sorted(
            (row for row in rows if row[2].phase is not Phase.RUNNING),
            key=lambda row: row[2].phase is not Phase.FAILED,
        )
        return {name: f"node {node} on bus {bus} {drive.words}" for name, (bus, node), drive in waiting}

    @property
    def left_out(self) -> dict[str, str]:
        """What drives lack that they may lack, by joint."""
        rows = zip(self._wiring.joints, self._drives, strict=True)
        return {name: "; ".join(said) for name, drive in rows if (said := drive.setup.plan.left_out)}
