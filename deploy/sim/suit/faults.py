"""Faults on demand: lost nodes, wrong readings, twins, late, corrupt and duplicate answers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from pydantic import Field

from common.can.frame import CanFrame
from common.clock import NS_PER_MS, to_s
from common.config.section import Section
from common.errors import ConfigMistake
from deploy.sim.suit.span import TimeSpan
from deploy.sim.suit.wrong_readings import WrongReading


class Loss(TimeSpan):
    """`[[faults.lose]]`: a node that does not answer."""

    node: str
    """Its segment."""


class Delay(TimeSpan):
    """`[[faults.delay]]`: a node that answers late."""

    node: str | None = None
    """Its segment; None: every node."""
    delay_ms: float = Field(gt=0.0)
    rate: float = Field(default=1.0, ge=0.0, le=1.0)
    """Share of its answers that are late."""


class Twin(TimeSpan):
    """`[[faults.twin]]`: a second node with the same id on the same bus, worn by another person."""

    node: str | None = None
    """Its segment; None: every node, which is a second suit."""


class FaultsConfig(Section):
    """`[faults]`: none by default."""

    wrong_reading: list[WrongReading] = Field(default=[])
    twin: list[Twin] = Field(default=[])
    lose: list[Loss] = Field(default=[])
    delay: list[Delay] = Field(default=[])
    corrupt_rate: float = Field(default=0.0, ge=0.0, le=1.0)
    """Share of the frames of which one byte is changed."""
    duplicate_rate: float = Field(default=0.0, ge=0.0, le=1.0)
    """Share of the frames that are sent twice."""

    def unknown_nodes(self, nodes: Sequence[str]) -> list[ConfigMistake]:
        """Faults of nodes that there are not."""
        named = [(f"faults.lose.{i}.node", loss.node) for i, loss in enumerate(self.lose)]
        named += [
            (f"faults.wrong_reading.{i}.node", wrong.node) for i, wrong in enumerate(self.wrong_reading)
        ]
        named += [(f"faults.twin.{i}.node", t.node) for i, t in enumerate(self.twin) if t.node is not None]
        named += [(f"faults.delay.{i}.node", d.node) for i, d in enumerate(self.delay) if d.node is not None]
        expected = "the segment of a configured node"
        return [ConfigMistake(key, node, expected) for key, node in named if node not in nodes]


class NodeAnswer(NamedTuple):
    """What a sound node sends in one tick."""

    node: str
    bus: str
    frames: list[CanFrame]


class Outgoing(NamedTuple):
    """A frame, the bus it goes to, and how long after the SYNC it is sent."""

    bus: str
    frame: CanFrame
    delay_ns: int


class Faults:
    """Turns sound answers into what a troubled suit sends. `config` may be replaced at any time."""

    def __init__(self, config: FaultsConfig, seed: int) -> None:
        self.config = config
        self._random = np.random.default_rng([seed, 2])

    def apply(self, answers: Sequence[NodeAnswer], t_ns: int) -> list[Outgoing]:
        """The frames that go out for one tick at `t_ns` since the first SYNC, in the order of the nodes."""
        t_s = to_s(t_ns)
        lost = {loss.node for loss in self.config.lose if loss.includes(t_s)}
        delays = [delay for delay in self.config.delay if delay.includes(t_s)]
        out = []
        for answer in answers:
            if answer.node in lost:
                continue
            delay_ns = self._delay_ns(answer.node, delays) if delays else 0
            out += [Outgoing(answer.bus, frame, delay_ns) for frame in answer.frames]
        if self.config.corrupt_rate:
            out = [self._corrupted(o) if self._happens(self.config.corrupt_rate) else o for o in out]
        if self.config.duplicate_rate:
            out = [copy for o in out for copy in [o] * (1 + self._happens(self.config.duplicate_rate))]
        return out

    def twins(self, t_ns: int) -> set[str] | None:
        """The segments whose node has a twin at that time; None: all of them."""
        active = [twin.node for twin in self.config.twin if twin.includes(to_s(t_ns))]
        return None if None in active else {node for node in active if node is not None}

    def _delay_ns(self, node: str, delays: list[Delay]) -> int:
        due = [d.delay_ms for d in delays if d.node in (None, node) and self._happens(d.rate)]
        return round(sum(due) * NS_PER_MS)

    def _corrupted(self, outgoing: Outgoing) -> Outgoing:
        data = bytearray(outgoing.frame.data)
        data[self._random.integers(len(data))] ^= int(self._random.integers(1, 256))
        return outgoing._replace(frame=replace(outgoing.frame, data=bytes(data)))

    def _happens(self, rate: float) -> bool:
        return bool(self._random.random() < rate)
