"""The frames of one window, of one answer format: decoded and checked all at once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from common.wire.messages import Mask
from master.suit.health import Counts, NodeCounters
from master.suit.layout import Raw
from master.suit.protocol import READINGS, AnswerFormat, NodeStatus

_Number = TypeVar("_Number", bound=np.generic)


@dataclass(frozen=True, slots=True)
class AnswerSlot:
    """Where a node stands: its index in node order, its number on the bus, and the bus's first key."""

    index: int
    node_id: int
    first_key: int


@dataclass(frozen=True, slots=True)
class NodeAnswers:
    """What the n nodes of one format answered in one window."""

    usable: Mask
    """(n,) all parts sound, of this tick, no fault."""
    heard: Mask
    """(n,) at least one sound frame, of whatever tick."""
    raw: Raw
    """(n, 9) counts, of meaning only where usable."""
    saturated: Mask
    """(n,) said that a reading is clipped."""
    differing: Mask
    """(n,) gave two different sound answers to one tick, this or the one before."""
    twice: Mask
    """(n,) gave more than one sound answer to one tick, whatever was in them."""


class Intake:
    """The n nodes that answer in one format. A frame's slot is its node's row here × parts + part.

    A key is a frame's identifier plus the first key of its bus, so that buses do not mix.
    """

    def __init__(self, form: AnswerFormat, places: Sequence[AnswerSlot]) -> None:
        self.length = form.length
        self.parts = len(form.parts)
        self.rows = np.array([place.index for place in places], dtype=np.intp)
        """(n,) index of each node in node order."""
        self._layout = form.parts[0]
        keyed = [(place, part) for place in places for part in form.parts]
        self.keys = [place.first_key + part.base_id + place.node_id for place, part in keyed]
        """Key of each slot."""
        self._blank = np.array(
            [part.crc.blank(part.base_id + place.node_id) for place, part in keyed], dtype=np.uint8
        )
        self._raw: Raw = np.zeros((len(keyed), len(READINGS) // self.parts), dtype=np.int16)
        self._got: Mask = np.zeros(len(keyed), dtype=np.bool_)
        """Slots that answered the last window, with `_raw`."""
        self._last_tick = -1
        self._all: Mask = np.ones(len(keyed), dtype=np.bool_)
        self._slots: list[int] = []
        self._frames: list[bytes] = []

    def tick_test(self, tick: int) -> tuple[int, int, int]:
        """(place, mask, value) of the data byte that tells cheaply whether a frame is of this tick."""
        field = self._layout.tick
        mask = (field.mask << field.shift) & 0xFF
        return field.byte, mask, (tick << field.shift) & mask

    def take_whole(self, frames: Mapping[int, bytes], tick: int) -> Raw | None:
        """The usual window in few steps: every slot's frame is there by its key, is sound, and has no status.

        Returns raw (n, 9), or None where anything at all is not so; then `add` and `take` say what.
        """
        chosen = [frames[key] for key in self.keys]
        if set(map(len, chosen)) != {self.length}:
            return None
        joined = b"".join(chosen)
        if not self._layout.is_all(joined, tick, status=0, folded=self._blank):
            return None
        self._raw = self._layout.raw(joined)
        self._got, self._last_tick = self._all, tick
        return self._by_node(self._raw)

    def add(self, slot: int, data: bytes) -> None:
        """One more frame, of the right length."""
        self._slots.append(slot)
        self._frames.append(data)

    def take(self, tick: int, counters: NodeCounters) -> NodeAnswers:
        """Check, count and empty what was added, for that tick."""
        slots = np.array(self._slots, dtype=np.intp)
        decoded = self._layout.decode(b"".join(self._frames))
        self._slots, self._frames = [], []

        intact = decoded.folded == self._blank[slots]
        good = intact & (decoded.tick == tick & self._layout.tick.mask)
        heard = self._frames_a_node(slots[intact]) > 0
        counters.bad_checksum[self.rows] += self._frames_a_node(slots[~intact])
        counters.bad_tick[self.rows] += self._frames_a_node(slots[intact & ~good])

        late = intact & ~good & (decoded.tick == self._last_tick & self._layout.tick.mask)
        late &= self._got[slots]
        again = self._again(slots, decoded.raw, late)
        # a copy: the raw readings of a whole window lie in its frames
        self._raw = self._raw.copy()
        # backwards: of two frames for one slot the later assignment stands, and the first frame should
        backwards = slots[good][::-1]
        self._raw[backwards] = decoded.raw[good][::-1]
        status = np.zeros(len(self.keys), dtype=np.uint8)
        status[backwards] = decoded.status[good][::-1]
        got = np.zeros(len(self.keys), dtype=np.bool_)
        got[backwards] = True
        counters.duplicates[self.rows] += self._frames_a_node(backwards) - self._by_node(got).sum(axis=1)
        again |= self._again(slots, decoded.raw, good)
        twice = self._frames_a_node(backwards) > self._by_node(got).sum(axis=1)
        twice |= self._frames_a_node(slots[late]) > 0
        self._got, self._last_tick = got, tick
        answers = self._judge(got, status, counters)
        return replace(answers, heard=heard, differing=again, twice=twice)

    def _again(self, slots: NDArray[np.intp], raw: Raw, chosen: Mask) -> Mask:
        """(n,) nodes of which a chosen frame says something else than what stands for its slot."""
        differs = (raw[chosen] != self._raw[slots[chosen]]).any(axis=1)
        return self._frames_a_node(slots[chosen][differs]) > 0

    def _judge(self, got: Mask, status: NDArray[np.uint8], counters: NodeCounters) -> NodeAnswers:
        answered: Mask = np.logical_and.reduce(self._by_node(got), axis=1)
        status_bits = np.bitwise_or.reduce(self._by_node(status), axis=1)
        fault = answered & (status_bits & NodeStatus.FAULT > 0)
        counters.faults[self.rows] += fault
        saturated = answered & (status_bits & NodeStatus.SATURATED > 0)
        counters.saturated[self.rows] += saturated
        return NodeAnswers(answered & ~fault, answered, self._by_node(self._raw), saturated, fault, fault)

    def _by_node(self, per_slot: NDArray[_Number]) -> NDArray[_Number]:
        return per_slot.reshape(len(self.rows), -1)

    def _frames_a_node(self, slots: NDArray[np.intp]) -> Counts:
        return np.bincount(slots // self.parts, minlength=len(self.rows))
