"""What a TOML says of a CAN bus; suit, master and the robot's drives share it."""

from __future__ import annotations

from collections.abc import Sequence

from pydantic import Field

from common.config.section import Section
from common.errors import ConfigMistake


class BusConfig(Section):
    """`[[capture.buses]]` of the master, `[[buses]]` of the suit: one CAN bus, opened by python-can."""

    name: str = Field(min_length=1)
    """What nodes, logs and counters call it."""
    interface: str = Field(min_length=1)
    """A python-can interface: `socketcan`, `udp_multicast`, `virtual`, ..."""
    channel: str = Field(min_length=1)
    """What that interface calls the bus: `can0`, a multicast group such as `239.74.163.2`, any text."""
    fd: bool = True
    """True: CAN FD, a node answers in one frame. False: classic CAN, in three."""
    options: dict[str, str | int | float | bool] = Field(default_factory=dict)
    """More keywords for `can.Bus`: `port` and `hop_limit` of udp_multicast, `bitrate` of an adapter, ..."""


def names_used_twice(buses: Sequence[BusConfig], key: str) -> list[ConfigMistake]:
    """A mistake for each name that more than one bus has."""
    names = [bus.name for bus in buses]
    twice = sorted({name for name in names if names.count(name) > 1})
    return [ConfigMistake(key, name, "a bus name used once") for name in twice]
