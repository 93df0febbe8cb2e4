"""`tandem replay` on a file: identical, begun later, and with one frame changed."""

from __future__ import annotations

import json
from pathlib import Path

import msgpack
import pytest

from common.errors import TandemError
from common.recording import McapRecorder
from deploy.ops.replay.command import replay
from deploy.recorded.recompute import Recorded
from master.journal.calls import FRAMES, decode_calls
from master.journal.context import describe
from tests.deploy.recorded.test_recompute import RecordedBench


@pytest.fixture(scope="module")
def bench() -> RecordedBench:
    bench = RecordedBench('motion="bottle"')
    bench.snapshot()
    bench.run(320)
    bench.snapshot()
    bench.run(320)
    bench.calls.flush()
    return bench


def write(path: Path, bench: RecordedBench, entries: list[Recorded]) -> Path:
    """One entry each 5 ms of the bench's clock, which its ticks are too."""
    stamp_ns = first_ns = 1_000_000_000
    with McapRecorder(path, describe(bench.config)) as recorder:
        for topic, payload in entries:
            recorder.put(topic, payload, stamp_ns)
            stamp_ns += 5_000_000 if topic == FRAMES else 0
    assert stamp_ns > first_ns
    return path


def test_the_whole_and_a_part_are_identical(
    tmp_path: Path, bench: RecordedBench, capsys: pytest.CaptureFixture[str]
) -> None:
    file = write(tmp_path / "a.mcap", bench, bench.entries)
    postures = []
    for from_s in (0.0, 2.5):
        replay([file], check=True, from_s=from_s, as_json=True)
        found = json.loads(capsys.readouterr().out)
        assert found["identical"] == found["postures"]
        postures.append(found["postures"])
    assert postures[0] >= 40
    assert 8 <= postures[1] <= 10, (
        "1.5 s from the second snapshot's tick 320 at 1.6 s, less what comes before 2.5 s"
    )


def test_a_changed_frame_is_named_and_ends_with_an_error(
    tmp_path: Path, bench: RecordedBench, capsys: pytest.CaptureFixture[str]
) -> None:
    entries = list(bench.entries)
    place = [i for i, entry in enumerate(entries) if entry.topic == FRAMES][400]
    calls = [list(call) for call in decode_calls(entries[place].payload)]
    frame = next(call for call in calls if len(call) == 5)
    frame[4] = 0  # late or not, a time alone changes nothing; the bytes do
    data = frame[3]
    assert isinstance(data, bytes)
    frame[3] = bytes([data[0] ^ 1, *data[1:]])
    entries[place] = Recorded(FRAMES, msgpack.packb((1, calls)))
    file = write(tmp_path / "b.mcap", bench, entries)
    with pytest.raises(TandemError, match="postures differ"):
        replay([file], check=True)
    assert "the first that differs: tick 4" in capsys.readouterr().out


def test_another_filter_is_compared_by_joint(
    tmp_path: Path, bench: RecordedBench, capsys: pytest.CaptureFixture[str]
) -> None:
    file = write(tmp_path / "c.mcap", bench, bench.entries)
    replay([file], filter_name="mahony", as_json=True)
    found = json.loads(capsys.readouterr().out)
    assert found["other"]
    assert found["identical"] < found["postures"], "the first second is invalid in both"
    assert 0.0 < max(found["worst_deg"].values()) < 20.0


def test_a_recording_of_the_link_says_why_it_cannot(tmp_path: Path) -> None:
    with McapRecorder(tmp_path / "d.mcap", {"robot": "robot-1"}) as recorder:
        recorder.put("tandem/robot-1/state", b"", 1)
    with pytest.raises(TandemError, match="--tap"):
        replay([tmp_path / "d.mcap"])
