"""A node against docs/suit-protocol.md: what is asked, and whether the answers keep the rules. Pure.

steps ─▶ SYNC, or something a node must not answer ─▶ frames ─▶ one verdict a node and rule
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from common.can.frame import CanFrame
from common.clock import NS_PER_MS
from master.suit.crc import frame_crc
from master.suit.nodes import NodeConfig
from master.suit.protocol import NodeStatus, SuitProtocol

PERIOD_NS = 5 * NS_PER_MS
MOST_LATE_NS = 4 * NS_PER_MS
"""R4: an answer is on the bus by then."""
_PLAIN = 100
_NUMBERS = (0, 1, 63, 64, 65, 2**16, 2**31 - 1, 2**31, 2**32 - 2, 2**32 - 1, 0, 7, 7 + 64)
"""Numbers that a SYNC may carry: they wrap, skip, and may come again."""
_QUIET = 40

RULES = {
    "R1": "answers each SYNC once, with every frame",
    "R2": "repeats the number of the SYNC",
    "R3": "every frame has its length and a right CRC",
    "R4": "answers within 4 ms",
    "R5": "sends nothing unasked",
    "R6": "does not answer a SYNC of a wrong length",
    "R7": "leaves the reserved bits of STATUS zero",
    "R8": "its readings move",
}


@dataclass(frozen=True, slots=True)
class AskedPeriod:
    """One period: what is sent, and the number that answers must bear; None: there must be none."""

    frame: CanFrame | None
    number: int | None
    rule: str


@dataclass(frozen=True, slots=True)
class RuleVerdict:
    """Whether one node keeps one rule."""

    node: str
    rule: str
    held: bool
    seen: str


@dataclass(slots=True)
class _Tested:
    identifiers: tuple[int, ...]
    broken: dict[str, list[str]] = field(default_factory=dict)
    raw: dict[int, set[bytes]] = field(default_factory=dict)
    """Readings that each identifier has borne."""
    got: dict[int, int] = field(default_factory=dict)
    answered: int = 0


class Conformance:
    """The test of all nodes at once. One `step` a period; frames in between."""

    def __init__(
        self, nodes: Mapping[str, NodeConfig], protocol: SuitProtocol, fd: Mapping[str, bool]
    ) -> None:
        """`fd` says of each bus whether it is CAN FD."""
        self._protocol = protocol
        self._fd = dict(fd)
        self._nodes: dict[str, _Tested] = {}
        self._of: dict[tuple[str, int], str] = {}
        for name, node in nodes.items():
            form = protocol.answer_format(fd[node.bus])
            identifiers = tuple(part.base_id + node.id for part in form.parts)
            self._nodes[name] = _Tested(identifiers)
            self._of.update({(node.bus, identifier): name for identifier in identifiers})
        self.steps: Sequence[AskedPeriod] = _steps(protocol)
        self._step: AskedPeriod | None = None
        self._asked_ns = 0
        self._asked = 0

    def begin(self, step: AskedPeriod, now_ns: int) -> CanFrame | None:
        """Begin a period; returns what to send."""
        self._conclude()
        self._step, self._asked_ns = step, now_ns
        self._asked += step.number is not None
        return step.frame

    def frame(self, bus: str, frame_id: int, data: bytes, now_ns: int) -> None:
        """Take one frame."""
        name, step = self._of.get((bus, frame_id)), self._step
        if name is None or step is None:
            return
        node = self._nodes[name]
        if step.number is None:
            self._break(name, step.rule, f"frame {frame_id:#x} came")
            return
        form = self._protocol.answer_format(self._fd[bus])
        part = form.parts[node.identifiers.index(frame_id)]
        if len(data) != part.length or frame_crc(frame_id, data[:-1]) != data[-1]:
            self._break(name, "R3", f"{data.hex()} in {frame_id:#x}")
            return
        decoded = part.decode(data)
        mask = part.tick.mask
        if int(decoded.tick[0]) != step.number & mask:
            self._break(name, "R2", f"{int(decoded.tick[0])} to the SYNC {step.number}")
        if int(decoded.status[0]) & ~int(NodeStatus.FAULT | NodeStatus.SATURATED):
            self._break(name, "R7", f"STATUS {int(decoded.status[0]):#x}")
        if now_ns - self._asked_ns > MOST_LATE_NS:
            self._break(name, "R4", f"{1e-6 * (now_ns - self._asked_ns):.1f} ms")
        node.got[frame_id] = node.got.get(frame_id, 0) + 1
        node.raw.setdefault(frame_id, set()).add(np.asarray(decoded.raw).tobytes())

    def verdicts(self) -> list[RuleVerdict]:
        """One for each node and rule."""
        self._conclude()
        self._step = None
        out = []
        for name, node in self._nodes.items():
            # a magnetometer of its own frame may be absent
            if any(len(node.raw.get(identifier, "ab")) < 2 for identifier in node.identifiers[:2]):
                self._break(name, "R8", "the same readings in every answer")
            for rule, words in RULES.items():
                broken = node.broken.get(rule, [])
                judged = node.answered > 0 or rule == "R1"
                seen = f"{len(broken)}×: {broken[0]}" if broken else f"{node.answered} answers"
                out.append(RuleVerdict(name, f"{rule}: {words}", judged and not broken, seen))
        return out

    def _conclude(self) -> None:
        """Whether each node answered the period that ends."""
        step = self._step
        for name, node in self._nodes.items():
            if step is not None and step.number is not None:
                counts = [node.got.get(identifier, 0) for identifier in node.identifiers]
                if counts != [1] * len(counts):
                    self._break(name, "R1", f"{counts} frames to the SYNC {step.number}")
                else:
                    node.answered += 1
            node.got = {}

    def _break(self, name: str, rule: str, seen: str) -> None:
        self._nodes[name].broken.setdefault(rule, []).append(seen)


def _steps(protocol: SuitProtocol) -> list[AskedPeriod]:
    numbers = [*range(_PLAIN), *_NUMBERS]
    asked = [AskedPeriod(protocol.sync(number), number, "R1") for number in numbers]
    short, long = (CanFrame(protocol.sync_id, bytes(length), fd=False) for length in (3, 8))
    # the answer to the last SYNC may still be under way
    pause = AskedPeriod(None, None, "R5")
    return [
        *asked,
        *[pause] * _QUIET,
        AskedPeriod(short, None, "R6"),
        AskedPeriod(long, None, "R6"),
        pause,
        pause,
    ]
