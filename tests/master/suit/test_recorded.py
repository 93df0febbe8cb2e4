"""A suit's readings in a recording: answers come back, the rest is NaN, and what is odd is refused."""

from __future__ import annotations

from pathlib import Path

import msgpack
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from common.errors import RecordingError
from common.recording import McapRecorder
from common.recording.sweeps import TOPIC, describe, read_sweeps
from master.calibrate.recording import load_recordings
from master.suit.recorded import encode_sweep
from master.suit.sweep import Sweep

NODES = ("hand", "thumb", "index")


def sweep(tick: int, fresh: tuple[bool, ...] = (True, True, True)) -> Sweep:
    values = np.arange(27.0).reshape(3, 9) + 100.0 * tick
    mag = values[:, 6:].copy()
    mag[2] = np.nan  # no magnetometer
    flags = np.array(fresh)
    return Sweep(tick, tick, tick, values[:, :3], values[:, 3:6], mag, flags, ~flags)


def written(path: Path, payloads: list[bytes], metadata: dict[str, str] | None = None) -> Path:
    said = describe("hand", NODES, 200.0) if metadata is None else metadata
    with McapRecorder(path, said) as recorder:
        for stamp, payload in enumerate(payloads):
            recorder.put(TOPIC, payload, stamp)
    return path


@settings(max_examples=25, derandomize=True, deadline=None)
@given(
    steps=st.lists(st.integers(1, 5), min_size=1, max_size=20),
    fresh=st.lists(st.tuples(st.booleans(), st.booleans(), st.booleans()), min_size=20, max_size=20),
)
def test_every_answer_stands_at_its_tick_and_nothing_else(
    tmp_path_factory: pytest.TempPathFactory, steps: list[int], fresh: list[tuple[bool, bool, bool]]
) -> None:
    ticks = 1000 + np.cumsum(steps)
    sent = [sweep(int(tick), answered) for tick, answered in zip(ticks, fresh, strict=False)]
    path = tmp_path_factory.mktemp("sweeps") / "a.mcap"
    read = read_sweeps(written(path, [encode_sweep(s) for s in sent]))
    assert (read.nodes, read.rate_hz, read.cut) == (NODES, 200.0, "")
    expected = np.full((ticks[-1] - ticks[0] + 1, 3, 9), np.nan)
    for s in sent:
        all_ = np.concatenate([s.acc_m_s2, s.gyr_rad_s, s.mag_ut], axis=1)
        expected[s.tick - ticks[0], s.fresh] = all_[s.fresh]
    np.testing.assert_allclose(read.readings, expected, rtol=1e-6)


def test_the_calibration_gets_the_nodes_that_answered(tmp_path: Path) -> None:
    path = written(tmp_path / "a.mcap", [encode_sweep(sweep(t, (True, False, True))) for t in (5, 6, 8)])
    nodes = load_recordings(path)
    assert set(nodes) == {"hand", "index"}
    assert nodes["index"].mag_ut is None
    hand = nodes["hand"]
    assert hand.rate_hz == 200.0
    assert hand.acc_m_s2.shape == (4, 3)
    assert np.isnan(hand.acc_m_s2[2]).all()
    assert hand.mag_ut is not None
    assert hand.mag_ut[3].tolist() == [806.0, 807.0, 808.0]


@pytest.mark.parametrize(
    ("payload", "said"),
    [
        (b"\xc1", "not of version 1"),
        (msgpack.packb((2, 1, b"\1\1\1", bytes(108))), "not of version 1"),
        (msgpack.packb((1, 1, b"\1\1", bytes(108))), "not of version 1"),
        (msgpack.packb((1, 1, b"\1\1\1", bytes(104))), "not of version 1"),
        (encode_sweep(sweep(7)), "do not follow one another"),
        (encode_sweep(sweep(10**9)), "do not follow one another"),
    ],
    ids=["no msgpack", "version", "mask", "length", "tick twice", "tick far away"],
)
def test_what_is_odd_is_refused(tmp_path: Path, payload: bytes, said: str) -> None:
    path = written(tmp_path / "a.mcap", [encode_sweep(sweep(7)), payload])
    with pytest.raises(RecordingError, match=said):
        load_recordings(path)


@pytest.mark.parametrize(
    "metadata",
    [
        {},
        {"nodes": "[]", "rate_hz": "200"},
        {"nodes": '["a"]', "rate_hz": "x"},
        {"nodes": "{", "rate_hz": "1"},
    ],
)
def test_a_recording_that_does_not_say_what_it_holds_is_refused(
    tmp_path: Path, metadata: dict[str, str]
) -> None:
    path = written(tmp_path / "a.mcap", [encode_sweep(sweep(1))], metadata)
    with pytest.raises(RecordingError, match="does not name its nodes"):
        load_recordings(path)


def test_one_of_other_topics_or_of_silent_nodes_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="holds no readings"):
        load_recordings(written(tmp_path / "a.mcap", []))
    silent = [encode_sweep(sweep(t, (False, False, False))) for t in (1, 2)]
    with pytest.raises(RecordingError, match="no node answered"):
        load_recordings(written(tmp_path / "b.mcap", silent))


def test_a_recording_that_was_cut_off_is_used_and_said(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path = tmp_path / "a.mcap"
    recorder = McapRecorder(path, describe("hand", NODES, 200.0), flush_s=0.0)
    for tick in range(50):
        recorder.put(TOPIC, encode_sweep(sweep(tick)), tick)
    recorder.close()
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    nodes = load_recordings(path)
    assert 1 <= len(nodes["hand"].acc_m_s2) < 50
    assert "was cut off" in caplog.text
