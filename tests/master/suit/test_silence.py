"""The first second without an answer says what to look at."""

from __future__ import annotations

from dataclasses import replace

import pytest

from common.clock import NS_PER_S
from master.suit.silence import AGAIN_NS, BusSigns, SilenceWatch, advice

QUIET = BusSigns(
    up=True, fd=True, sync_id=0x80, received=0, fresh=0, unknown_id=0, bad_length=0, bad_checksum=0,
    bad_tick=0, error_frames=0, send_errors=0,
)  # fmt: skip


@pytest.mark.parametrize(
    ("counter", "words"),
    [
        ("bad_length", "wrong length"),
        ("unknown_id", "no configured node"),
        ("bad_tick", "another tick"),
        ("bad_checksum", "checksums are wrong"),
        ("error_frames", "controller reports errors"),
        ("send_errors", "not acknowledged"),
    ],
)
def test_what_was_counted_names_the_cause(counter: str, words: str) -> None:
    counted = {counter: 1}
    assert words in advice(QUIET, replace(QUIET, **counted))  # type: ignore[arg-type]
    assert words not in advice(QUIET, QUIET)


def test_without_any_sign_all_usual_causes_are_named() -> None:
    said = advice(QUIET, QUIET)
    assert all(word in said for word in ("power", "bit rate", "120 Ω", "fd (here CAN FD)", "SYNC 0x80"))


def test_nodes_that_answer_and_a_bus_that_is_down_need_no_advice() -> None:
    assert advice(QUIET, replace(QUIET, fresh=1, bad_length=9)) == ""
    assert advice(QUIET, replace(QUIET, up=False)) == ""


def test_it_is_said_after_the_first_second_and_then_seldom() -> None:
    watch = SilenceWatch()
    said = [watch.lines({"suit": QUIET}, second * NS_PER_S) for second in range(1 + AGAIN_NS // NS_PER_S + 1)]
    assert [bool(lines) for lines in said] == [False, True] + [False] * (len(said) - 3) + [True]
    assert watch.lines({"suit": replace(QUIET, fresh=200)}, 99 * NS_PER_S) == []
