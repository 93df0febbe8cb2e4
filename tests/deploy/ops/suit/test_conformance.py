"""A node that keeps docs/suit-protocol.md passes; one that breaks a rule fails that rule, and it alone."""

from __future__ import annotations

import itertools
from collections.abc import Callable

import numpy as np
import pytest

from common.can.frame import CanFrame
from deploy.ops.suit.conformance import PERIOD_NS, RULES, Conformance
from master.suit.nodes import NodeConfig
from master.suit.protocol import SuitProtocol

PROTOCOL = SuitProtocol.load()
NODES = {"head": NodeConfig(id=5, bus="arm")}
Answer = Callable[[CanFrame | None, int], list[tuple[int, CanFrame]]]
"""What a node sends to what it hears in a period, each with its delay in ns."""


def good(fd: bool, late_ns: int = 1_000_000, status: int = 0, still: bool = False) -> Answer:
    def answer(asked: CanFrame | None, period: int) -> list[tuple[int, CanFrame]]:
        if asked is None or len(asked.data) != 4:
            return []
        raw = (np.arange(9) + (0 if still else period)).astype(np.int16)
        frames = PROTOCOL.encode_sample(5, raw, PROTOCOL.parse_sync(asked.data), status, fd)
        return [(late_ns, frame) for frame in frames]

    return answer


def broken(fd: bool, answer: Answer) -> set[str]:
    test = Conformance(NODES, PROTOCOL, {"arm": fd})
    for period, step in enumerate(test.steps):
        now_ns = period * PERIOD_NS
        asked = test.begin(step, now_ns)
        for late_ns, frame in answer(asked, period):
            test.frame("arm", frame.id, frame.data, now_ns + late_ns)
    verdicts = test.verdicts()
    assert len(verdicts) == len(RULES)
    return {verdict.rule[:2] for verdict in verdicts if not verdict.held}


@pytest.mark.parametrize("fd", [True, False])
def test_a_good_node_keeps_every_rule(fd: bool) -> None:
    assert broken(fd, good(fd)) == set()


Change = Callable[[CanFrame | None, int, list[tuple[int, CanFrame]]], list[tuple[int, CanFrame]]]


def other(fd: bool, change: Change) -> Answer:
    honest = good(fd)
    return lambda asked, period: change(asked, period, honest(asked, period))


def wrong_crc(frame: CanFrame) -> CanFrame:
    return CanFrame(frame.id, frame.data[:-1] + bytes([frame.data[-1] ^ 1]), frame.fd)


@pytest.mark.parametrize("fd", [True, False])
def test_each_broken_rule_is_found(fd: bool) -> None:
    unasked = PROTOCOL.encode_sample(5, np.arange(9, dtype=np.int16), 0, 0, fd)
    cases: dict[str, Answer] = {
        "R1": other(fd, lambda asked, period, sent: [] if period == 7 else sent),
        "R2": other(
            fd, lambda asked, period, sent: good(fd)(PROTOCOL.sync(3), period) if period == 7 else sent
        ),
        "R3": other(fd, lambda asked, period, sent: [(late, wrong_crc(frame)) for late, frame in sent]),
        "R4": good(fd, late_ns=4_500_000),
        "R5": other(fd, lambda asked, period, sent: sent if asked else [(0, frame) for frame in unasked]),
        "R6": other(
            fd, lambda asked, period, sent: [(0, f) for f in unasked] if asked and not sent else sent
        ),
        "R7": good(fd, status=4),
        "R8": good(fd, still=True),
    }
    if not fd:
        del cases["R7"]  # two bits: none is reserved
    for rule, answer in cases.items():
        found = broken(fd, answer)
        if rule == "R3":
            found -= {rule[:1] + other for other in "1245678"}  # no answer is left
        elif rule == "R8":
            # ticks differ, the readings do not
            assert rule in found
            continue
        assert found == {rule}, rule


def test_a_silent_node_keeps_no_rule() -> None:
    assert broken(True, lambda asked, period: []) == set(RULES)


def test_numbers_wrap_and_come_again() -> None:
    asked = [
        step.number for step in Conformance(NODES, PROTOCOL, {"arm": True}).steps if step.number is not None
    ]
    assert {0, 63, 64, 2**32 - 1} <= set(asked)
    assert any(b < a for a, b in itertools.pairwise(asked))


@pytest.mark.parametrize("voided", [True, False])
def test_a_period_in_which_this_host_was_stalled_is_asked_again(voided: bool) -> None:
    """Every tenth answer seems 9 ms late, as this host read it late; without `void` the node is blamed."""
    answer, test = good(fd=True), Conformance(NODES, PROTOCOL, {"arm": True})
    now_ns = 0
    for period, step in enumerate(test.steps):
        now_ns += 2 * PERIOD_NS
        stalled = period % 10 == 0
        asked = test.begin(step, now_ns)
        for late_ns, frame in answer(asked, period):
            test.frame("arm", frame.id, frame.data, now_ns + (9_000_000 if stalled else late_ns))
        test.end(now_ns + (PERIOD_NS + 5_000_000 if stalled else PERIOD_NS))
    if voided:
        again = test.void(lambda began_ns, ended_ns: ended_ns - began_ns > PERIOD_NS + 1_000_000)
        assert len(again) == -(-len(test.steps) // 10)
        assert test.void(lambda began_ns, ended_ns: ended_ns - began_ns > PERIOD_NS + 1_000_000) == []
    assert {v.rule[:2] for v in test.verdicts() if not v.held} == (set() if voided else {"R4"})
