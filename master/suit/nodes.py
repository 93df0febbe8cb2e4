"""What a TOML says of the CAN buses and of the nodes on them; master and simulated suit share it."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from common.config import RelativePath, Section


class BusConfig(Section):
    """`[[buses]]`: one CAN bus, opened by python-can."""

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


class NodeConfig(Section):
    """`[nodes.<segment>]`: one inertial node, named after the segment that carries it."""

    id: int = Field(ge=1, le=127)
    """Its number on the bus: added to the identifiers of the DBC."""
    bus: str = Field(min_length=1)
    """Name of the bus it hangs on."""
    magnetometer: bool = True
    """False: it has none, and its filter runs on gyro and accelerometer."""
    filter: Literal["vqf", "mahony"] | None = None
    """Orientation filter of this node; None takes the suit's."""
    calibration: RelativePath | None = None
    """Its calibration TOML; None leaves the readings as they come."""
