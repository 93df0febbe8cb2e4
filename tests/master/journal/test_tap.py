"""When the master hands a snapshot to its tap, and that a snapshot which fails stops nothing."""

from __future__ import annotations

import pytest

from common.clock import NS_PER_S
from master.journal import tap as tap_module
from master.journal.calls import ANGLES, FRAMES, SNAPSHOT
from master.journal.tap import MasterTap
from tests.master.test_pipeline import Bench


class Readers:
    def __init__(self) -> None:
        self.read, self.behind = True, True
        self.topics: list[str] = []

    def put(self, topic: str, payload: bytes, stamp_ns: int | None = None) -> None:
        self.topics.append(topic)

    def put_snapshot(self, topic: str, payload: bytes) -> None:
        self.behind = False
        self.topics.append(topic)


@pytest.fixture
def tapped() -> tuple[MasterTap, Readers, Bench]:
    bench, readers = Bench(), Readers()
    tap = MasterTap(bench.pipeline, readers)
    bench.pipeline = tap.pipeline  # type: ignore[assignment]  # what the bench calls of it, it has
    return tap, readers, bench


def rested(tap: MasterTap, readers: Readers, seconds: float) -> int:
    """How many snapshots come at that time."""
    before = readers.topics.count(SNAPSHOT)
    tap.rest(round(seconds * NS_PER_S))
    return readers.topics.count(SNAPSHOT) - before


def test_a_snapshot_comes_for_who_is_behind_and_each_minute(tapped: tuple[MasterTap, Readers, Bench]) -> None:
    tap, readers, _ = tapped
    assert rested(tap, readers, 0.001) == 1
    assert rested(tap, readers, 59.9) == 0
    assert rested(tap, readers, 60.1) == 1
    readers.behind = True
    assert rested(tap, readers, 62.0) == 0, "one that keeps falling behind asks for none each tick"
    assert rested(tap, readers, 62.2) == 1


def test_calls_of_a_tick_are_cut_at_the_snapshot(tapped: tuple[MasterTap, Readers, Bench]) -> None:
    tap, readers, bench = tapped
    bench.run(2)
    tap.rest(bench.now_ns)
    assert [topic for topic in readers.topics if topic != ANGLES] == [FRAMES, FRAMES, SNAPSHOT]


def test_without_readers_nothing_is_put(tapped: tuple[MasterTap, Readers, Bench]) -> None:
    tap, readers, bench = tapped
    readers.read = False
    bench.run(20)
    tap.rest(bench.now_ns)
    assert readers.topics == []


def test_a_snapshot_that_fails_is_said_once_and_the_frames_go_on(
    tapped: tuple[MasterTap, Readers, Bench],
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
) -> None:
    tap, readers, bench = tapped

    def fails(_: object) -> None:
        raise OverflowError("int too big")

    monkeypatch.setattr(tap_module, "recall", fails)
    assert rested(tap, readers, 1.0) == 0
    assert rested(tap, readers, 100.0) == 0
    assert caplog.text.count("cannot be computed again") == 1
    bench.run(2)
    assert FRAMES in readers.topics
