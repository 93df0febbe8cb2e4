"""A node against docs/suit-protocol.md: what is asked, and whether the answers keep the rules. Pure.

steps ─▶ SYNC, or something a node must not answer ─▶ frames ─▶ one verdict a node and rule
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
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
class _AskedNow:
    """What one period showed."""

    step: AskedPeriod
    began_ns: int
    ended_ns: int = 0
    broken: list[tuple[str, str, str]] = field(default_factory=list)
    """Node, rule, and what breaks it."""
    got: Counter[tuple[str, int]] = field(default_factory=Counter)
    """Sound frames by node and identifier."""
    raw: list[tuple[str, int, bytes]] = field(default_factory=list)
    """The readings of each, by node and identifier."""


class Conformance:
    """The test of all nodes at once. One `step` a period; frames in between."""

    def __init__(
        self, nodes: Mapping[str, NodeConfig], protocol: SuitProtocol, fd: Mapping[str, bool]
    ) -> None:
        """`fd` says of each bus whether it is CAN FD."""
        self._protocol = protocol
        self._fd = dict(fd)
        self._identifiers: dict[str, tuple[int, ...]] = {}
        self._of: dict[tuple[str, int], str] = {}
        for name, node in nodes.items():
            form = protocol.answer_format(fd[node.bus])
            identifiers = tuple(part.base_id + node.id for part in form.parts)
            self._identifiers[name] = identifiers
            self._of.update({(node.bus, identifier): name for identifier in identifiers})
        self.steps: Sequence[AskedPeriod] = _steps(protocol)
        self._periods: list[_AskedNow] = []
        self._now: _AskedNow | None = None

    def begin(self, step: AskedPeriod, now_ns: int) -> CanFrame | None:
        """Begin a period, which ends the one before; returns what to send."""
        self.end(now_ns)
        self._now = _AskedNow(step, now_ns)
        self._periods.append(self._now)
        return step.frame

    def end(self, now_ns: int) -> None:
        """End the period under way: frames that come between two periods are not judged."""
        if self._now is not None:
            self._now.ended_ns = now_ns
        self._now = None

    def void(self, stalled: Callable[[int, int], bool]) -> list[AskedPeriod]:
        """Forget the periods in which this host was stalled, and return them: they are to be asked again.

        `stalled` takes the beginning and the end of a period, ns.
        """
        spoiled = [each for each in self._periods if stalled(each.began_ns, each.ended_ns)]
        self._periods = [each for each in self._periods if each not in spoiled]
        return [each.step for each in spoiled]

    def frame(self, bus: str, frame_id: int, data: bytes, now_ns: int) -> None:
        """Take one frame."""
        name, now = self._of.get((bus, frame_id)), self._now
        if name is None or now is None:
            return
        if now.step.number is None:
            now.broken.append((name, now.step.rule, f"frame {frame_id:#x} came"))
            return
        form = self._protocol.answer_format(self._fd[bus])
        part = form.parts[self._identifiers[name].index(frame_id)]
        if len(data) != part.length or frame_crc(frame_id, data[:-1]) != data[-1]:
            now.broken.append((name, "R3", f"{data.hex()} in {frame_id:#x}"))
            return
        decoded = part.decode(data)
        mask = part.tick.mask
        if int(decoded.tick[0]) != now.step.number & mask:
            words = f"{int(decoded.tick[0])} to the SYNC {now.step.number}"
            now.broken.append((name, "R2", words))
        if int(decoded.status[0]) & ~int(NodeStatus.FAULT | NodeStatus.SATURATED):
            now.broken.append((name, "R7", f"STATUS {int(decoded.status[0]):#x}"))
        if now_ns - now.began_ns > MOST_LATE_NS:
            now.broken.append((name, "R4", f"{1e-6 * (now_ns - now.began_ns):.1f} ms"))
        now.got[name, frame_id] += 1
        now.raw.append((name, frame_id, np.asarray(decoded.raw).tobytes()))

    def verdicts(self) -> list[RuleVerdict]:
        """One for each node and rule."""
        out = []
        for name, identifiers in self._identifiers.items():
            broken: dict[str, list[str]] = {}
            for period in self._periods:
                for node, rule, seen in period.broken:
                    if node == name:
                        broken.setdefault(rule, []).append(seen)
            unanswered = self._unanswered(name)
            if unanswered:
                broken["R1"] = unanswered
            raw = {(which, data) for each in self._periods for node, which, data in each.raw if node == name}
            # a magnetometer of its own frame may be absent
            if any(sum(which == identifier for which, _ in raw) == 1 for identifier in identifiers[:2]):
                broken.setdefault("R8", []).append("the same readings in every answer")
            answered = sum(each.step.number is not None for each in self._periods) - len(unanswered)
            for rule, words in RULES.items():
                wrong = broken.get(rule, [])
                judged = answered > 0 or rule == "R1"
                said = f"{len(wrong)}×: {wrong[0]}" if wrong else f"{answered} answers"
                out.append(RuleVerdict(name, f"{rule}: {words}", judged and not wrong, said))
        return out

    def _unanswered(self, name: str) -> list[str]:
        """The SYNCs to which a node did not send each of its frames once, in words."""
        identifiers = self._identifiers[name]
        counts = [
            (each.step.number, [each.got[name, identifier] for identifier in identifiers])
            for each in self._periods
            if each.step.number is not None
        ]
        return [f"{got} frames to the SYNC {number}" for number, got in counts if got != [1] * len(got)]


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
