"""Frames of nodes of one layout, gathered into samples and read all at once. Pure.

A sample begins with the layout's `first` message and is whole once every message it needs has come. A frame
that was lost thus loses its sample, and never mixes two.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from common.clock import to_ns
from common.quaternion import IDENTITY, Array, conjugate, from_axis_angle, multiply
from common.wire.messages import Mask
from master.capture.bits import IntegerField, SignalReader
from master.capture.layout import MappedLayout
from master.capture.parts import CHANNELS, MAG, TURN, NodeLayout

_STALE_MAG_NS = to_ns(0.1)
"""A slower magnetometer's last reading is used for so long."""
_NORM = (0.9, 1.1)
"""Length of a quaternion that is one."""


@dataclass(frozen=True, slots=True)
class NodeSamples:
    """F samples in the order of arrival."""

    rows: NDArray[np.intp]
    """(F,) node of each."""
    arrival_ns: NDArray[np.int64]
    """(F,) of its first frame."""
    values: Array
    """(F, CHANNELS): readings in SI and in the sensor's axes, q_world_from_sensor, own time in s, count."""


@dataclass(slots=True)
class Gathering:
    """One node's frames since its sample began."""

    frames: list[bytes | None]
    waits_for: int = 0
    arrival_ns: int = 0
    aside: dict[int, tuple[bytes, int]] | None = None
    """The newest frame of each part that is not waited for, and its arrival."""


class LayoutDecoder:
    """The nodes of one layout whose frames have one shape. `frame` puts aside, `take` reads."""

    def __init__(self, layout: MappedLayout, shape: NodeLayout, rows: Sequence[int]) -> None:
        """`rows`: the nodes' numbers among all free-running ones."""
        self.layout = layout
        self.nodes = np.array(rows, np.intp)
        """(n,) number of each among all free-running nodes."""
        self._first = shape.first
        self._needed = [part.needed for part in shape.parts]
        self._count = sum(self._needed)
        self._readers = [
            SignalReader([each.signal for each in part.mapped], part.message.length) for part in shape.parts
        ]
        self._channels = [[each.channel for each in part.mapped] for part in shape.parts]
        self._factors = [np.array([each.factor for each in part.mapped]) for part in shape.parts]
        self._gathering = [Gathering([None] * len(shape.parts)) for _ in rows]
        self._whole: list[tuple[int, int, list[bytes | None]]] = []
        self.incomplete = np.zeros(len(rows), np.int64)
        """(n,) samples of which a frame was missing."""
        self.short = np.zeros(len(rows), np.int64)
        """(n,) frames too short for their signals."""

    def frame(self, node: int, part: int, data: bytes, now_ns: int) -> None:
        """Take one frame of this decoder's node number `node`."""
        if len(data) < self._readers[part].length:
            self.short[node] += 1
            return
        gathering = self._gathering[node]
        if not self._needed[part]:
            gathering.aside = {**(gathering.aside or {}), part: (data, now_ns)}
            return
        if part == self._first:
            self.incomplete[node] += gathering.waits_for > 0
            gathering.frames = [None] * len(self._needed)
            gathering.waits_for, gathering.arrival_ns = self._count, now_ns
        elif gathering.waits_for == 0 or gathering.frames[part] is not None:
            # its sample's first frame was lost, or one in between
            self.incomplete[node] += gathering.waits_for > 0
            gathering.waits_for = 0
            return
        gathering.frames[part] = data
        gathering.waits_for -= 1
        if gathering.waits_for == 0:
            for place, (aside, heard_ns) in (gathering.aside or {}).items():
                if now_ns - heard_ns < _STALE_MAG_NS:
                    gathering.frames[place] = aside
            self._whole.append((node, gathering.arrival_ns, gathering.frames))

    def drop(self, nodes: Mask) -> None:
        """Forget what nodes (n,) have begun, as their bus has failed."""
        self._whole = [sample for sample in self._whole if not nodes[sample[0]]]
        for node in np.flatnonzero(nodes):
            self._gathering[node].waits_for, self._gathering[node].aside = 0, None

    def take(self) -> NodeSamples | None:
        """The samples that have become whole since the last call; None where there is none."""
        whole, self._whole = self._whole, []
        if not whole:
            return None
        values = np.full((len(whole), CHANNELS), np.nan)
        for part, (reader, channels) in enumerate(zip(self._readers, self._channels, strict=True)):
            frames = [sample[2][part] for sample in whole]
            heard = [frame for frame in frames if frame is not None]
            if len(heard) == len(frames):
                values[:, channels] = reader.read(heard) * self._factors[part]
            elif heard:
                there = np.flatnonzero([frame is not None for frame in frames])
                values[there[:, None], channels] = reader.read(heard) * self._factors[part]
        self._turn(values)
        rows = self.nodes[[node for node, _, _ in whole]]
        return NodeSamples(rows, np.array([arrival for _, arrival, _ in whole], np.int64), values)

    def _turn(self, values: Array) -> None:
        """From the unit's axes and world into the sensor's and tandem's, in place."""
        layout = self.layout
        values[:, :9] = values[:, layout.take] * layout.signs
        # no power or an open bus: a field of exactly nothing
        values[(values[:, MAG] == 0.0).all(axis=1), MAG] = np.nan
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


class Route:
    """Whose frame one identifier of one bus is, as far as it takes a look into the frame."""

    def __init__(self) -> None:
        self._ways: list[
            tuple[tuple[IntegerField, ...], dict[tuple[int, ...], tuple[LayoutDecoder, int, int]]]
        ]
        self._ways = []
        self._names: list[tuple[str, ...]] = []
        self._only: tuple[LayoutDecoder, int, int] | None = None

    def add(
        self, fields: dict[str, IntegerField], values: tuple[int, ...], to: tuple[LayoutDecoder, int, int]
    ) -> bool:
        """Frames whose fields have these values go `to` a decoder's node and part. False: taken already."""
        names = tuple(fields)
        if names not in self._names:
            self._names.append(names)
            self._ways.append((tuple(fields.values()), {}))
        slots = self._ways[self._names.index(names)][1]
        taken = values in slots
        slots.setdefault(values, to)
        self._only = to if len(self._ways) == 1 and not names else None
        return not taken

    def frame(self, data: bytes, now_ns: int) -> bool:
        """Hand one frame on; False where it is no node's."""
        if self._only is not None:
            decoder, node, part = self._only
            decoder.frame(node, part, data, now_ns)
            return True
        found = False
        for fields, slots in self._ways:
            to = slots.get(tuple([field.read(data) for field in fields]))
            if to is not None:
                to[0].frame(to[1], to[2], data, now_ns)
                found = True
        return found
