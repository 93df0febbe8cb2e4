"""A recording of many files: nothing falls between two of them; where no next one can begin, it ends."""

from __future__ import annotations

import asyncio
import gc
import threading
import tracemalloc
from pathlib import Path

import pytest

from common.clock import to_ns
from common.recording import McapRecorder, read_recording
from deploy.ops.record.tape import Tape


class Clock:
    def __init__(self) -> None:
        self.now_ns = 0

    def __call__(self) -> int:
        return self.now_ns


def messages(path: Path) -> list[int]:
    return [int.from_bytes(entry.payload, "little") for entry in read_recording(path).entries]


def test_the_index_of_an_open_file_is_small_and_goes_with_it(tmp_path: Path) -> None:
    """An hour has 7200 chunks: with a file an hour the memory of a recorder is bounded."""
    chunks, most_of_an_hour = 400, 20_000_000

    def held() -> int:
        gc.collect()
        return tracemalloc.get_traced_memory()[0]

    tracemalloc.start()
    try:
        before = held()
        recorder = McapRecorder(tmp_path / "a.mcap", {}, flush_s=0.0)
        for number in range(chunks):
            for topic in ("suit/frames", "suit/angles", "tandem/robot-1/state", "tandem/robot-1/command"):
                recorder.put(topic, number.to_bytes(1200, "big"), number)
            while recorder.counters.written < 4 * (number + 1):
                threading.Event().wait(0.0005)
        each = (held() - before) / chunks
        recorder.close()
        del recorder
        after = held() - before
    finally:
        tracemalloc.stop()
    assert each * 7200 < most_of_an_hour, f"{each:.0f} bytes a chunk"
    assert after < 0.3 * each * chunks, "it goes when the file is closed"


async def filled(tape: Tape, clock: Clock, count: int) -> None:
    """A message a second."""
    for i in range(count):
        clock.now_ns = to_ns(i)
        await tape.turn()
        tape.put("state", i.to_bytes(4, "little"), clock.now_ns)
    await tape.close()


def test_a_new_file_begins_in_time_and_nothing_is_lost_between(tmp_path: Path) -> None:
    clock, out = Clock(), tmp_path / "night.mcap"
    tape = Tape(out, {"robot": "r"}, 10.0, clock)
    asyncio.run(filled(tape, clock, 25))
    assert tape.files == [out, tmp_path / "night-2.mcap", tmp_path / "night-3.mcap"]
    assert [messages(path) for path in tape.files] == [
        list(range(10)), list(range(10, 20)), list(range(20, 25)),
    ]  # fmt: skip
    assert read_recording(tape.files[2]).metadata == {"robot": "r", "continues": "night-2.mcap"}
    counters = tape.counters()
    assert (counters.put, counters.written, counters.refused, counters.failed) == (25, 25, 0, "")


def test_one_file_for_all_where_nobody_wants_more(tmp_path: Path) -> None:
    clock, out = Clock(), tmp_path / "night.mcap"
    tape = Tape(out, {}, None, clock)
    asyncio.run(filled(tape, clock, 25))
    assert tape.files == [out]
    assert messages(out) == list(range(25))


def test_a_next_file_that_cannot_begin_ends_the_recording_said_once(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    clock, out = Clock(), tmp_path / "night.mcap"
    (tmp_path / "night-2.mcap").write_text("somebody else's")
    tape = Tape(out, {}, 10.0, clock)
    asyncio.run(filled(tape, clock, 45))
    assert messages(out) == list(range(10))
    assert (tmp_path / "night-2.mcap").read_text() == "somebody else's"
    counters = tape.counters()
    assert (counters.put, counters.written, counters.refused) == (45, 10, 35)
    assert "is there already" in counters.failed
    assert len([r for r in caplog.records if "the recording stops here" in r.message]) == 1
