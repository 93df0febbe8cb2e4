"""Frames of nodes of one layout, gathered into samples and read all at once. Pure.

A sample begins with the layout's `first` message and is whole once every message it needs has come. A frame
that was lost thus loses its sample, and never mixes two. Frames are gathered as they come; the samples that
have become whole are read once a tick, all in one product.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np

from common.clock import to_ns
from common.quaternion import IDENTITY, Array, conjugate, from_axis_angle, multiply
from common.wire.messages import Mask
from master.capture.bits import Placed, SignalReader
from master.capture.layout import MappedLayout
from master.capture.parts import CHANNELS, MAG, TURN, Mapped, NodeLayout

_STALE_MAG_NS = to_ns(0.1)
"""A slower magnetometer's last reading is used for so long."""
_NORM = (0.9, 1.1)
"""Length of a quaternion that is one."""
_SAMPLES_A_NODE = 64
"""Room between two ticks; a node that sends more babbles."""

_NEVER_NS = -(2**62)

_Whole = tuple[int, int, list[bytes], tuple[bytes | None, ...]]
"""A whole sample: its node's number, its first frame's arrival in ns, its frames, and those heard aside."""


@dataclass(frozen=True, slots=True)
class NodeSamples:
    """F samples, those of each node in the order of arrival."""

    rows: Sequence[int]
    """The node of each."""
    arrival_ns: Sequence[int]
    """Of its first frame."""
    values: Array
    """(F, CHANNELS): readings in SI and in the sensor's axes, q_world_from_sensor, own time in s, count."""


@dataclass(slots=True)
class _Gathering:
    """What has come of one node."""

    number: int
    """In its decoder."""
    aside: list[tuple[bytes | None, int]]
    """The newest frame of each part that is not waited for, and its arrival in ns."""
    begun: list[bytes] | None = None
    """The frames of the sample that has begun, in their order in it, b"" for those that it lacks."""
    missing: int = 0
    """Frames that it lacks."""
    begun_ns: int = 0


class LayoutDecoder:
    """The nodes of one layout whose frames have one shape. `frame` gathers, `take` reads."""

    def __init__(self, layout: MappedLayout, shape: NodeLayout, rows: Sequence[int]) -> None:
        """`rows`: the nodes' numbers among all free-running ones."""
        self.layout = layout
        self._rows = list(rows)
        self.nodes = np.array(rows, np.intp)
        """(n,) number of each among all free-running nodes."""
        self.parts = len(shape.parts)
        needed = [place for place, part in enumerate(shape.parts) if part.needed]
        if shape.first in needed:
            needed = [shape.first, *(place for place in needed if place != shape.first)]
        aside = [place for place in range(self.parts) if place not in needed]
        order = [*needed, *aside]
        self._order = [order.index(place) for place in range(self.parts)]
        """Of each part in a sample, that with which it begins at first, those not waited for at last."""
        self._needed = len(needed)
        self._rest = [b""] * (len(needed) - 1)
        self._lengths = [part.message.length for part in shape.parts]
        mapped = [[self._in_axes(each) for each in shape.parts[place].mapped] for place in order]
        begins = np.cumsum([0, *(8 * self._lengths[place] for place in needed)]).tolist()
        self._reader = SignalReader(
            [
                Placed(each.signal, begin, each.factor)
                for begin, part in zip(begins, mapped, strict=False)
                for each in part
            ],
            begins[-1] // 8,
            [each.channel for part in mapped[: self._needed] for each in part],
            CHANNELS,
        )
        self._aside_readers = [
            (
                [each.channel for each in part],
                SignalReader([Placed(each.signal, 0, each.factor) for each in part], self._lengths[place]),
            )
            for place, part in zip(aside, mapped[self._needed :], strict=True)
        ]
        self._nothing_aside: list[tuple[bytes | None, int]] = [(None, _NEVER_NS)] * len(aside)
        self._of_node = [_Gathering(number, list(self._nothing_aside)) for number in range(len(rows))]
        self._whole: list[_Whole] = []
        """Since the last `take`, in the order in which they became whole."""
        self._room = _SAMPLES_A_NODE * len(rows)
        self.incomplete = np.zeros(len(rows), np.int64)
        """(n,) samples of which a frame was missing."""
        self.short = np.zeros(len(rows), np.int64)
        """(n,) frames too short for their signals."""

    def _in_axes(self, mapped: Mapped) -> Mapped:
        """A reading in the unit's axes as that of the sensor's axis that it is."""
        if mapped.channel >= len(self.layout.signs):
            return mapped
        axis = self.layout.take.tolist().index(mapped.channel)
        return replace(mapped, channel=axis, factor=mapped.factor * float(self.layout.signs[axis]))

    def frame(self, slot: int, data: bytes, now_ns: int) -> bool:
        """Take one frame; `slot`: its node's number here × parts + part. False: there are far too many."""
        place, part = divmod(slot, self.parts)
        node, order, length = self._of_node[place], self._order[part], self._lengths[part]
        if len(data) != length:
            if len(data) < length:
                self.short[place] += 1
                return True
            data = data[:length]
        if order == 0:
            return self._begin(node, data, now_ns)
        if order >= self._needed:
            node.aside[order - self._needed] = data, now_ns
            return True
        begun = node.begun
        if begun is None:
            return True
        if begun[order]:  # a frame of another sample, whose first one was lost
            node.begun = None
            self.incomplete[place] += 1
            return True
        begun[order] = data
        node.missing -= 1
        if node.missing == 0:
            self._end(node, begun, now_ns)
        return True

    def _begin(self, node: _Gathering, data: bytes, now_ns: int) -> bool:
        if node.begun is not None:
            self.incomplete[node.number] += 1
            node.begun = None
        if len(self._whole) >= self._room:
            return False
        begun = node.begun = [data, *self._rest]
        node.begun_ns, node.missing = now_ns, len(self._rest)
        if not self._rest:
            self._end(node, begun, now_ns)
        return True

    def _end(self, node: _Gathering, begun: list[bytes], now_ns: int) -> None:
        heard: tuple[bytes | None, ...] = ()
        if node.aside:
            heard = tuple([data if now_ns - at_ns < _STALE_MAG_NS else None for data, at_ns in node.aside])
        self._whole.append((node.number, node.begun_ns, begun, heard))
        node.begun = None

    def drop(self, nodes: Mask) -> None:
        """Forget what nodes (n,) have sent, as their bus has failed."""
        self._whole = [sample for sample in self._whole if not nodes[sample[0]]]
        for node in self._of_node:
            if nodes[node.number]:
                node.begun, node.aside = None, list(self._nothing_aside)

    def take(self) -> NodeSamples | None:
        """The samples that have become whole since the last call; None where there is none."""
        if not self._whole:
            return None
        whole, self._whole = self._whole, []
        numbers, arrivals, frames, asides = zip(*whole, strict=True)
        values = self._reader.read(b"".join(chain.from_iterable(frames)))
        for place, (channels, reader) in enumerate(self._aside_readers):
            heard = {row: aside[place] for row, aside in enumerate(asides) if aside[place] is not None}
            if heard:
                values[np.array(list(heard))[:, None], channels] = reader.read(b"".join(heard.values()))
        self._turn(values)
        return NodeSamples([self._rows[number] for number in numbers], arrivals, values)

    def _turn(self, values: Array) -> None:
        """Orientations from the unit's axes and world into the sensor's and tandem's, in place."""
        layout = self.layout
        # no power or an open bus: a field of exactly nothing
        dead = ~values[:, MAG].any(axis=1)
        if dead.any():
            values[dead, MAG] = np.nan
        orientation = layout.config.orientation
        if orientation is None:
            return
        given = values[:, TURN]
        q = given if orientation.quaternion else of_euler(given[:, :3], orientation.sequence)
        length = np.sqrt(np.einsum("ni,ni->n", q, q))
        wrong = ~((length > _NORM[0]) & (length < _NORM[1]))
        q = np.where(wrong[:, None], IDENTITY, q / np.where(wrong, 1.0, length)[:, None])
        if orientation.inverse:
            q = conjugate(q)
        q = multiply(layout.q_world, multiply(q, conjugate(layout.q_unit)))
        values[:, TURN] = np.where(wrong[:, None], np.nan, q)


def of_euler(angles_rad: Array, sequence: str) -> Array:
    """(F, 4) of angles (F, 3) about the axes of `sequence`: upper case intrinsic, lower case extrinsic."""
    turns = [
        from_axis_angle(np.eye(3)["xyz".index(letter.lower())], angles_rad[:, place])
        for place, letter in enumerate(sequence)
    ]
    first, second, third = turns if sequence.isupper() else reversed(turns)
    return multiply(first, multiply(second, third))
