"""What a TOML says of the nodes on the CAN buses; master and simulated suit share it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from pydantic import Field

from common.can.config import BusConfig, names_used_twice
from common.config.section import RelativePath, Section
from common.errors import ConfigMistake


class NodeConfig(Section):
    """`[nodes.<segment>]`: one inertial node, named after the segment that carries it."""

    id: int = Field(ge=1, le=127)
    """Its number on the bus: added to the identifiers of the DBC."""
    bus: str = Field(min_length=1)
    """Name of the bus it hangs on."""
    layout: str | None = None
    """Name of its `[suit.layout.NAME]`; None takes `suit.default`, or else tandem's own protocol."""
    magnetometer: bool = True
    """False: it has none, and its filter runs on gyro and accelerometer."""
    filter: str | None = None
    """Name of this node's orientation filter; None takes the suit's. The master's file checks the name."""
    calibration: RelativePath | None = None
    """Its calibration TOML; None leaves the readings as they come."""


def wiring_mistakes(
    nodes: Mapping[str, NodeConfig], buses: Sequence[BusConfig], buses_key: str
) -> list[ConfigMistake]:
    """Bus names used twice, nodes on a bus that there is not, and two nodes with one id on one bus."""
    names = [bus.name for bus in buses]
    mistakes = names_used_twice(buses, buses_key)
    taken: dict[tuple[str, str | None, int], str] = {}
    for segment, node in nodes.items():
        if node.bus not in names:
            mistakes.append(ConfigMistake(f"nodes.{segment}.bus", node.bus, f"one of {', '.join(names)}"))
        other = taken.setdefault((node.bus, node.layout, node.id), segment)
        if other != segment:
            expected = f"an id that nodes.{other} does not have"
            mistakes.append(ConfigMistake(f"nodes.{segment}.id", node.id, expected))
    return mistakes
