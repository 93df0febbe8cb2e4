"""Frames of nodes of one layout, gathered into samples and read all at once. Pure.

A sample begins with the layout's `first` message and is whole once every message it needs has come. A frame
that was lost thus loses its sample, and never mixes two. A frame is only put aside when it comes: gathering
and reading are done once a tick, for all frames together.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from common.clock import to_ns
from common.quaternion import IDENTITY, Array, conjugate, from_axis_angle, multiply
from common.wire.messages import Mask
from master.capture.bits import Placed, SignalReader
from master.capture.layout import MappedLayout
from master.capture.parts import CHANNELS, MAG, TURN, NodeLayout

_STALE_MAG_NS = to_ns(0.1)
"""A slower magnetometer's last reading is used for so long."""
_NORM = (0.9, 1.1)
"""Length of a quaternion that is one."""
_FRAMES_A_PART = 64
"""Room for each frame that may come between two ticks; a bus with more than that babbles."""

Frame = tuple[int, bytes, int]
"""Slot, data, arrival in ns. The slot is the node's number in its decoder times the parts, plus the part."""


@dataclass(frozen=True, slots=True)
class NodeSamples:
    """F samples, those of each node in the order of arrival."""

    rows: NDArray[np.intp]
    """(F,) node of each."""
    arrival_ns: NDArray[np.int64]
    """(F,) of its first frame."""
    values: Array
    """(F, CHANNELS): readings in SI and in the sensor's axes, q_world_from_sensor, own time in s, count."""


@dataclass(frozen=True, slots=True)
class _Whole:
    """W samples that are whole."""

    nodes: NDArray[np.intp]
    """(W,) number of each one's node in the decoder."""
    frames: NDArray[np.intp]
    """(W, P) place of each one's frame of each needed part."""


class LayoutDecoder:
    """The nodes of one layout whose frames have one shape. `frame` puts aside, `take` reads."""

    def __init__(self, layout: MappedLayout, shape: NodeLayout, rows: Sequence[int]) -> None:
        """`rows`: the nodes' numbers among all free-running ones."""
        self.layout = layout
        self.nodes = np.array(rows, np.intp)
        """(n,) number of each among all free-running nodes."""
        self.parts = len(shape.parts)
        self._lengths = [part.message.length for part in shape.parts]
        needed = [place for place, part in enumerate(shape.parts) if part.needed]
        self._first = needed.index(shape.first) if shape.first in needed else 0
        self._needed = needed
        self._aside = [place for place in range(self.parts) if place not in needed]
        self._order = np.full(self.parts, -1, np.intp)
        self._order[needed] = np.arange(len(needed))
        begins = np.cumsum([0, *(self._lengths[place] for place in needed)])
        self._reader = SignalReader(
            [
                Placed(each.signal, 8 * int(begin), each.factor)
                for begin, place in zip(begins, needed, strict=False)
                for each in shape.parts[place].mapped
            ],
            int(begins[-1]),
        )
        self._channels = [each.channel for place in needed for each in shape.parts[place].mapped]
        self._aside_readers = {
            place: SignalReader(
                [Placed(each.signal, 0, each.factor) for each in shape.parts[place].mapped],
                self._lengths[place],
            )
            for place in self._aside
        }
        self._aside_channels = {
            place: [each.channel for each in shape.parts[place].mapped] for place in self._aside
        }
        self._newest_aside: dict[int, tuple[bytes, int]] = {}
        """The newest frame of each part that is not waited for, by slot, and its arrival."""
        self.waiting: list[Frame] = []
        """In the order of arrival; of each node at first what it has begun."""
        self.room = _FRAMES_A_PART * self.parts * len(rows)
        self.incomplete = np.zeros(len(rows), np.int64)
        """(n,) samples of which a frame was missing."""
        self.short = np.zeros(len(rows), np.int64)
        """(n,) frames too short for their signals."""

    def frame(self, slot: int, data: bytes, now_ns: int) -> bool:
        """Put one frame aside; False where there are far too many."""
        waiting = self.waiting
        if len(waiting) >= self.room:
            return False
        waiting.append((slot, data, now_ns))
        return True

    def drop(self, nodes: Mask) -> None:
        """Forget what nodes (n,) have begun, as their bus has failed."""
        self.waiting = [frame for frame in self.waiting if not nodes[frame[0] // self.parts]]
        self._newest_aside = {
            slot: kept for slot, kept in self._newest_aside.items() if not nodes[slot // self.parts]
        }

    def take(self) -> NodeSamples | None:
        """The samples that have become whole since the last call; None where there is none."""
        if not self.waiting:
            return None
        waiting, self.waiting = self.waiting, []
        slots, datas, arrivals = zip(*waiting, strict=True)
        slot = np.array(slots, np.intp)
        length = np.fromiter(map(len, datas), np.intp, len(datas))
        part = slot % self.parts
        bad = length < np.array(self._lengths)[part]
        if bad.any():
            np.add.at(self.short, slot[bad] // self.parts, 1)
        before = dict(self._newest_aside)
        chosen = np.flatnonzero(~bad & (self._order[part] >= 0))
        whole = self._gather(slot[chosen], chosen, waiting)
        for place in np.flatnonzero(~bad & (self._order[part] < 0)).tolist() if self._aside else ():
            self._newest_aside[slots[place]] = datas[place], arrivals[place]
        if len(whole.nodes) == 0:
            return None
        values = np.full((len(whole.nodes), CHANNELS), np.nan)
        values[:, self._channels] = self._reader.read(self._joined(whole, datas))
        arrival = np.array(arrivals, np.int64)
        if self._aside:
            self._read_aside(values, whole, waiting, before)
        self._turn(values)
        return NodeSamples(self.nodes[whole.nodes], arrival[whole.frames[:, self._first]], values)

    def _gather(self, slot: NDArray[np.intp], place: NDArray[np.intp], waiting: list[Frame]) -> _Whole:
        """The whole samples among frames in the order of arrival; what was begun goes on waiting.

        A sample is the first frames from a node's first part on, as many as there are needed parts, if each
        part is there once.
        """
        count = len(self._needed)
        none = _Whole(np.zeros(0, np.intp), np.zeros((0, count), np.intp))
        if len(slot) == 0:
            return none
        by_node = np.argsort(slot // self.parts, kind="stable")
        node, order, place = (
            slot[by_node] // self.parts,
            self._order[slot[by_node] % self.parts],
            place[by_node],
        )
        begins = order == self._first
        another = np.empty(len(node), np.bool_)
        another[0] = True
        np.not_equal(node[1:], node[:-1], out=another[1:])
        starts = np.flatnonzero(begins | another)
        sample = np.repeat(np.arange(len(starts)), np.diff(starts, append=len(node)))
        rank = np.arange(len(node)) - starts[sample]
        used = (rank < count) & begins[starts][sample]
        bits = np.bincount(sample[used], weights=np.ldexp(1.0, order[used]), minlength=len(starts))
        have = np.bincount(sample[used], minlength=len(starts))
        # as many different powers of two as there are parts add up to this, and no others
        whole = (have == count) & (bits == 2.0**count - 1.0)
        last = np.append(another[starts[1:]], True)
        goes_on = last & (have < count) & (have > 0)
        broken = (have > 0) & ~whole & ~goes_on
        if broken.any():
            np.add.at(self.incomplete, node[starts[broken]], 1)
        if goes_on.any():
            self.waiting = [waiting[i] for i in place[used & goes_on[sample]].tolist()]
        good = used & whole[sample]
        frames = np.empty((int(whole.sum()), count), np.intp)
        frames[np.repeat(np.arange(len(frames)), count), order[good]] = place[good]
        return _Whole(node[starts[whole]], frames)

    def _joined(self, whole: _Whole, datas: Sequence[bytes]) -> bytes:
        """The data of all samples, each one's needed parts one after the other."""
        chosen = [datas[place] for place in whole.frames.ravel().tolist()]
        joined = b"".join(chosen)
        if len(joined) == len(whole.nodes) * self._reader.length:
            return joined
        lengths = [self._lengths[place] for place in self._needed] * len(whole.nodes)
        return b"".join([data[:length] for data, length in zip(chosen, lengths, strict=True)])

    def _read_aside(
        self, values: Array, whole: _Whole, waiting: Sequence[Frame], before: dict[int, tuple[bytes, int]]
    ) -> None:
        """The newest frame, before a sample was whole, of each part that it does not wait for."""
        ends = whole.frames.max(axis=1)
        for part in self._aside:
            heard: list[bytes] = []
            there: list[int] = []
            for row, node in enumerate(whole.nodes.tolist()):
                slot, end = node * self.parts + part, int(ends[row])
                newest = next(
                    (frame[1:] for frame in reversed(waiting[:end]) if frame[0] == slot), before.get(slot)
                )
                if newest is not None and waiting[end][2] - newest[1] < _STALE_MAG_NS:
                    heard.append(newest[0][: self._lengths[part]])
                    there.append(row)
            if heard:
                read = self._aside_readers[part].read(b"".join(heard))
                values[np.array(there)[:, None], self._aside_channels[part]] = read

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
