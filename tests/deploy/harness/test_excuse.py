"""A stall excuses only where it is shown to be the host's: each case of the rule, and each part is needed."""

from __future__ import annotations

from dataclasses import dataclass

import pytest

from common.clock import NS_PER_MS, to_ns
from deploy.harness.excuse import STILL_S, WINDOW_S, Lost, Stall, StallEvidence, lost, lost_before

AT_NS = to_ns(10.0)


def stall(ms: float, stolen_ms: float = 0.0, priority: bool = False, ago_ms: float = 0.0) -> Stall:
    """One that ended `ago_ms` before AT_NS."""
    until_ns = AT_NS - round(ago_ms * NS_PER_MS)
    lasted_ns = round(ms * NS_PER_MS)
    return Stall(0, until_ns - lasted_ns, until_ns, 1, round(stolen_ms * NS_PER_MS), priority)


@dataclass(frozen=True)
class Case:
    stalls: tuple[Stall, ...]
    excuses: bool
    evidence: StallEvidence


STILL_MS, WINDOW_MS = 1e3 * STILL_S, 1e3 * WINDOW_S
CASES = {
    "nothing": Case((), False, StallEvidence.NONE),
    "priority, long enough": Case((stall(STILL_MS, priority=True),), True, StallEvidence.PRIORITY),
    "priority, too short": Case((stall(STILL_MS - 1, priority=True),), False, StallEvidence.PRIORITY),
    "priority, in pieces": Case(
        (stall(STILL_MS - 10, priority=True), stall(10, priority=True, ago_ms=300)),
        True,
        StallEvidence.PRIORITY,
    ),
    "priority, just within the window": Case(
        (stall(WINDOW_MS, priority=True, ago_ms=WINDOW_MS - STILL_MS),), True, StallEvidence.PRIORITY
    ),
    "priority, too early": Case(
        (stall(WINDOW_MS, priority=True, ago_ms=WINDOW_MS - STILL_MS + 1),), False, StallEvidence.PRIORITY
    ),
    "own load": Case((stall(400),), False, StallEvidence.NONE),
    "own load, again and again": Case(
        tuple(stall(100, ago_ms=110 * i) for i in range(5)), False, StallEvidence.NONE
    ),
    "stolen": Case((stall(STILL_MS, STILL_MS),), True, StallEvidence.STEAL),
    "stolen in part": Case((stall(400, STILL_MS - 10),), False, StallEvidence.STEAL),
    "stolen enough": Case((stall(400, STILL_MS),), True, StallEvidence.STEAL),
    "stolen before the stall": Case((stall(STILL_MS - 10, 400),), False, StallEvidence.STEAL),
    "one stolen, one of own load": Case((stall(20, 20), stall(100, ago_ms=100)), False, StallEvidence.STEAL),
}


def wrong() -> list[str]:
    """The cases that come out otherwise."""
    found = {name: lost_before(case.stalls, AT_NS) for name, case in CASES.items()}
    return [
        name
        for name, case in CASES.items()
        if (found[name].explains_hold, found[name].evidence) != (case.excuses, case.evidence)
    ]


def test_what_excuses_and_what_does_not() -> None:
    assert wrong() == []


def whole(stall: Stall) -> int:
    return stall.until_ns - stall.from_ns


MUTANTS = {
    "every stall excuses": whole,
    "any steal excuses all of a stall": lambda s: whole(s) if s.priority or s.stolen_ns else 0,
    "more is excused than it lasted": lambda s: whole(s) if s.priority else s.stolen_ns,
    "priority excuses nothing": lambda s: min(whole(s), s.stolen_ns),
    "steal excuses nothing": lambda s: whole(s) if s.priority else 0,
}


@pytest.mark.parametrize("name", MUTANTS)
def test_without_any_part_of_the_rule_a_case_comes_out_otherwise(
    monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    monkeypatch.setattr(Stall, "excused_ns", property(MUTANTS[name]))
    assert wrong() != []


@pytest.mark.parametrize(
    ("found", "words"),
    [
        (
            lost((stall(60, priority=True),), 0, AT_NS),
            "the host stalled for 60 ms: the reference loop had",
        ),
        (lost((stall(60, 20),), 0, AT_NS), "the host stalled for 20 ms: /proc/stat shows steal"),
        (
            lost((stall(60),), 0, AT_NS),
            "a core came back 60 ms late, not excused: neither real-time priority nor",
        ),
        (Lost(0.0, 0.0, StallEvidence.NONE), "the host kept its time"),
    ],
)
def test_the_words_say_which_evidence_excused(found: Lost, words: str) -> None:
    assert str(found).startswith(words)


def test_a_moment_is_counted_once_and_only_as_far_as_it_lies_within() -> None:
    two = (stall(40, priority=True), stall(40, priority=True, ago_ms=20))
    assert lost(two, 0, AT_NS).excused_s == pytest.approx(0.06)
    assert lost(two, AT_NS - 50 * NS_PER_MS, AT_NS - 10 * NS_PER_MS).excused_s == pytest.approx(0.04)
    assert lost_before(two, AT_NS, since_ns=AT_NS - 10 * NS_PER_MS).excused_s == pytest.approx(0.01)
