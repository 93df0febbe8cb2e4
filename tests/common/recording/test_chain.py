"""The chain that a recorder writes as it goes vouches for all up to its last link, but no changed byte."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from common.errors import RecordingError
from common.recording import McapRecorder, check_recording, read_recording


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording of five chunks."""
    path = tmp_path_factory.mktemp("chain") / "whole.mcap"
    with McapRecorder(path, {"robot": "robot-1"}, flush_s=1000.0) as recorder:
        for chunk in range(5):
            for number in range(20):
                recorder.put("topic", bytes([chunk, number]) * 200, number)
            while recorder._queue.qsize():
                pass
            recorder._flush()
    return path


def test_a_whole_file_is_vouched_for_up_to_its_index(whole: Path) -> None:
    found = check_recording(whole)
    assert not found.broken
    assert found.links >= 5
    assert 0.5 * found.size < found.sealed < found.size
    assert len(found.head) == 64
    assert len(read_recording(whole).entries) == 100, "a reader of tandem's passes over the links"


@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(st.data())
def test_any_changed_byte_before_the_last_link_is_found(
    whole: Path, tmp_path: Path, data: st.DataObject
) -> None:
    sound = check_recording(whole)
    at = data.draw(st.integers(8, sound.sealed - 1))
    changed = bytearray(whole.read_bytes())
    changed[at] ^= data.draw(st.integers(1, 255))
    (path := tmp_path / "changed.mcap").write_bytes(changed)
    found = check_recording(path)
    assert found.broken, "also where a record's length is hit, and the records cannot be followed any more"
    assert found.sealed <= at


def test_a_changed_length_of_a_record_is_no_end(whole: Path, tmp_path: Path) -> None:
    """It would look like a file that was cut off there."""
    content, at = bytearray(whole.read_bytes()), 8
    while at < check_recording(whole).sealed:
        for changed in (at + 1, at + 3, at + 8):
            (path := tmp_path / "changed.mcap").write_bytes(
                content[:changed] + bytes([content[changed] ^ 0x41]) + content[changed + 1 :]
            )
            assert check_recording(path).broken, changed
        at += 9 + int.from_bytes(content[at + 1 : at + 9], "little")


@settings(max_examples=30, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(st.floats(0.02, 1.0))
def test_a_file_that_was_cut_off_is_vouched_for_up_to_its_last_link(
    whole: Path, tmp_path: Path, share: float
) -> None:
    size = int(share * whole.stat().st_size)
    (path := tmp_path / "cut.mcap").write_bytes(whole.read_bytes()[:size])
    found = check_recording(path)
    assert not found.broken
    assert found.sealed <= size


def test_a_killed_recorders_file_is_sealed_up_to_its_last_flush(tmp_path: Path) -> None:
    recorder = McapRecorder(tmp_path / "a.mcap", {}, flush_s=1000.0)
    recorder.put("topic", b"kept" * 100, 1)
    while recorder._queue.qsize():
        pass
    recorder._flush()
    recorder.put("topic", b"lost" * 100, 2)
    killed = Path(shutil.copy(recorder.path, tmp_path / "killed.mcap"))
    recorder.close()
    found = check_recording(killed)
    assert (found.broken, found.links) == ("", 2)
    assert found.sealed > 0.7 * found.size, "what is behind it is the last link's own record"
    assert check_recording(recorder.path).links == 3


def test_what_is_no_recording_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.mcap").write_bytes(b"nothing")
    with pytest.raises(RecordingError, match="not an MCAP file"):
        check_recording(tmp_path / "a.mcap")
    with pytest.raises(RecordingError, match="cannot be read"):
        check_recording(tmp_path / "none.mcap")
