"""The suit that a master's file describes: polled, free-running or mixed, with one interface."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TypeAlias

import numpy as np

from common.can.config import BusConfig
from common.can.frame import EXTENDED
from common.errors import ConfigError, ConfigMistake
from common.quaternion import Array
from common.wire.messages import Mask
from master.capture.config import SuitSection
from master.capture.layout import MappedLayout, load_layout
from master.capture.mixed import MixedSuit
from master.suit.nodes import NodeConfig
from master.suit.poll import Poll
from master.suit.protocol import SuitProtocol

SuitSource: TypeAlias = Poll | MixedSuit
OWN = "tandem"
"""What a node names as its layout where `suit.default` is another one."""


def with_layouts(nodes: Mapping[str, NodeConfig], suit: SuitSection) -> dict[str, NodeConfig]:
    """The nodes with the layout of each; None is tandem's own protocol."""
    out = {}
    for segment, node in nodes.items():
        layout = node.layout or suit.default
        out[segment] = node.model_copy(update={"layout": None if layout == OWN else layout})
    return out


def load_layouts(nodes: Mapping[str, NodeConfig], suit: SuitSection) -> dict[str, MappedLayout]:
    """The layouts that the nodes name, read against their DBCs. Raises ConfigError with every mistake."""
    named = with_layouts(nodes, suit)
    out: dict[str, MappedLayout] = {}
    mistakes: list[ConfigMistake] = []
    for name, config in suit.layout.items():
        numbers = [node.id for node in named.values() if node.layout == name]
        try:
            out[name] = load_layout(name, config, numbers)
        except ConfigError as error:
            mistakes += error.mistakes
    if mistakes:
        raise ConfigError("the master's file", mistakes)
    return out


def suit_source(
    segments: Sequence[str],
    nodes: Mapping[str, NodeConfig],
    suit: SuitSection,
    protocol: SuitProtocol,
    lost_after: int,
    fd: Mapping[str, bool],
) -> SuitSource:
    """The suit, its rows in the order of `segments`. Raises ConfigError."""
    named = with_layouts(nodes, suit)
    if all(segment in named and named[segment].layout is None for segment in segments):
        return Poll([named[segment] for segment in segments], protocol, lost_after, fd)
    layouts = load_layouts(nodes, suit)
    delay_s = None if suit.delay_ms is None else 1e-3 * suit.delay_ms
    rows = [named.get(segment) for segment in segments]
    return MixedSuit(rows, protocol, layouts, lost_after, fd, delay_s)


def suit_mistakes(
    nodes: Mapping[str, NodeConfig], suit: SuitSection, buses: Sequence[BusConfig], segments: Sequence[str]
) -> list[ConfigMistake]:
    """Layouts that do not exist or do not fit their DBC, and segments that have and have not a node."""
    out = suit.mistakes()
    known = ", ".join(suit.layout) or "no [suit.layout.NAME] yet"
    for segment, node in nodes.items():
        if node.layout not in (None, OWN, *suit.layout):
            expected = f"one of the layouts: {known}"
            out.append(ConfigMistake(f"nodes.{segment}.layout", node.layout, expected))
    for segment in suit.without_node:
        key = f"suit.without_node.{segment}"
        if segment not in segments:
            out.append(ConfigMistake(key, segment, "a segment of the profile"))
        elif segment in nodes:
            out.append(ConfigMistake(key, suit.without_node[segment], f"no [nodes] line for {segment} too"))
    if out or not suit.layout:
        return out
    try:
        layouts = load_layouts(nodes, suit)
    except ConfigError as error:
        return error.mistakes
    return [*out, *_kind_mistakes(with_layouts(nodes, suit), layouts, buses)]


def _kind_mistakes(
    nodes: Mapping[str, NodeConfig], layouts: Mapping[str, MappedLayout], buses: Sequence[BusConfig]
) -> list[ConfigMistake]:
    """CAN FD messages on a classic bus."""
    classic = {bus.name for bus in buses if not bus.fd}
    out = {}
    for node in nodes.values():
        if node.layout is None or node.bus not in classic:
            continue
        for part in layouts[node.layout].parts:
            if part.message.is_fd:
                expected = f"a bus with fd = true: {part.message.name} of {node.layout} is a CAN FD message"
                out[node.bus, part.message.name] = ConfigMistake("capture.buses", node.bus, expected)
    return list(out.values())


def with_extended(identifiers: Iterable[tuple[str, int]]) -> frozenset[str]:
    """The buses of (bus, identifier) on which nodes use identifiers of 29 bits."""
    return frozenset(bus for bus, frame_id in identifiers if frame_id & EXTENDED)


def counts_of(source: SuitSource, protocol: SuitProtocol) -> tuple[Array, Array, Mask | None]:
    """SI per count, the largest readings, and the nodes whose readings follow from an orientation.

    (9,) and (6,) where all nodes are of one kind, else (N, 9) and (N, 6); the last is None or (N,).
    """
    scale = protocol.fd.scale
    top = 32767.0 * scale[:6]
    if isinstance(source, Poll):
        return scale, top, None
    kinds = source.kinds
    scales, tops = np.tile(scale, (len(kinds), 1)), np.tile(top, (len(kinds), 1))
    derived = np.zeros(len(kinds), np.bool_)
    for row, kind in enumerate(kinds):
        if kind is not None:
            scales[row], tops[row] = kind.scale, kind.top
            derived[row] = kind.config.accelerometer is None or kind.config.gyroscope is None
    return scales, tops, derived
