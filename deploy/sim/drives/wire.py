"""The `canopen` library's network without its threads."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import Any

import canopen

EDS = Path(__file__).with_name("drive.eds")
Send = Callable[[int, bytes], None]
"""(identifier, data)."""


@lru_cache(maxsize=2)
def dictionary(wide_period: bool = False) -> canopen.ObjectDictionary:
    """The entries of `drive.eds`, shared by all drives. Their values are kept in each drive's node.

    `wide_period`: with 16 bits in 60C2h:1.
    """
    entries: Any = canopen.import_od(str(EDS), node_id=1)
    if wide_period:
        entries[0x60C2][1].data_type = canopen.objectdictionary.datatypes.UNSIGNED16
    read: canopen.ObjectDictionary = entries
    return read


class Wire(canopen.Network):
    """The library's network without its threads: what it sends goes to the bus, what beats is timed here."""

    def __init__(self, send: Send) -> None:
        super().__init__()
        self._deliver = send

    def send_message(self, can_id: int, data: Any, remote: bool = False) -> None:
        """Called by the library for each frame that it sends."""
        self._deliver(can_id, bytes(data))

    def send_periodic(self, can_id: int, data: Any, period: float, remote: bool = False) -> Any:
        """Called by the library to start a heartbeat; `SimulatedDrive.beat` sends the real one."""
        return _Beat()


class _Beat:
    """A heartbeat as the library sees it; `SimulatedDrive.beat` sends the real one."""

    def update(self, data: object) -> None:
        """The state is read when it is sent."""

    def stop(self) -> None:
        """The period is read when it is due."""
