"""An hour of recording: what stays in memory is the index of its chunks, and no more."""

from __future__ import annotations

import io
import itertools
import time
import tracemalloc
from pathlib import Path
from typing import BinaryIO, cast

import pytest

from common.recording import McapRecorder
from common.recording import recorder as module
from common.recording.chain import RunningChain
from common.recording.recorder import FLUSH_S

TOPICS = [f"tandem/robot-1/topic-{number}" for number in range(10)]
"""As many as a master and its robot have: the index has an entry for each in each chunk."""
MESSAGES = 18_000
"""Some ten in each chunk of half a second: a quarter of an hour."""
LOOK_NS = 25_000_000
MOST_BYTES_AN_HOUR = 12_000_000
"""8.0 were measured."""


class Sink(io.RawIOBase):
    """Counts what is written, and keeps nothing."""

    size = 0

    def write(self, data: object) -> int:
        length = memoryview(data).nbytes  # type: ignore[arg-type]  # bytes, as of a file
        self.size += length
        return length

    def tell(self) -> int:
        return self.size


def test_an_hour_keeps_its_index_in_memory_and_nothing_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    looks, links = itertools.count(), itertools.count()
    # the recorder's clock goes on by each look at it, two a message: how fast this machine is does not matter
    monkeypatch.setattr(module, "monotonic_ns", lambda: LOOK_NS * next(looks))
    link = RunningChain.link
    monkeypatch.setattr(RunningChain, "link", lambda chain: (next(links), link(chain))[1])
    sink = Sink()
    recorder = McapRecorder(tmp_path / "hour.mcap", {}, capacity=100, stream=cast(BinaryIO, sink))
    tracemalloc.start()
    try:
        for number in range(MESSAGES):
            while not recorder.put(TOPICS[number % len(TOPICS)], bytes([number % 256]) * 2000, number):
                time.sleep(0)
        used, chunks = tracemalloc.get_traced_memory()[0], next(links)
        recorder.close()
    finally:
        tracemalloc.stop()
    assert recorder.counters.written == MESSAGES
    assert chunks > 1000
    an_hour = used / chunks * 3600.0 / FLUSH_S
    assert an_hour < MOST_BYTES_AN_HOUR, f"{an_hour / 1e6:.1f} MB an hour"
