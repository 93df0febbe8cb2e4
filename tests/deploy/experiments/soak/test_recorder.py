"""The soak's recorder: no fault ends it before it has written a message, and its last message is found."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import cast

import pytest

from common.clock import monotonic_ns, to_ns
from common.errors import TandemError
from common.link.config import LinkConfig
from common.recording import McapRecorder
from deploy.experiments.soak.recorder import RecorderProcess
from deploy.harness.child import Child

METADATA = {"robot": "robot-1"}


class IdleChild:
    """Of a process that is never started, only its log's place."""

    def __init__(self, folder: Path) -> None:
        self.log = folder / "recorder.log"


@pytest.fixture
def recorder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> RecorderProcess:
    monkeypatch.setenv("PATH", "")  # without `nice`: nothing else runs that the reading could delay
    process = RecorderProcess(cast(Child, IdleChild(tmp_path)), tmp_path, LinkConfig(), "robot-1")
    process.file = tmp_path / "recording-0001.mcap"
    return process


def written(path: Path, *stamps_ns: int) -> None:
    with McapRecorder(path, METADATA) as file:
        for at_ns in stamps_ns:
            file.put("robot-1/state", b"x", at_ns)


def test_without_a_file_or_a_message_it_does_not_write(recorder: RecorderProcess) -> None:
    with pytest.raises(TandemError, match="has written no message within 0 s"):
        asyncio.run(recorder.until_it_writes(0.0))
    written(recorder.file)
    with pytest.raises(TandemError, match="has written no message within 0 s"):
        asyncio.run(recorder.until_it_writes(0.0))


def test_with_a_message_in_its_file_it_writes(recorder: RecorderProcess) -> None:
    written(recorder.file, 7)
    asyncio.run(recorder.until_it_writes(0.0))


def test_killed_just_after_it_began_a_file_its_last_message_is_in_the_file_before(
    recorder: RecorderProcess,
) -> None:
    ended_ns = monotonic_ns()
    written(recorder.file, ended_ns - to_ns(0.25))
    written(recorder.file.with_name("recording-0001-2.mcap"))
    found = asyncio.run(recorder.look(ended_ns))
    assert found.readable
    assert found.lost_s == pytest.approx(0.25)


def test_a_file_without_a_message_is_reported_with_its_reason(recorder: RecorderProcess) -> None:
    written(recorder.file)
    found = asyncio.run(recorder.look())
    assert not found.readable
    assert found.why_not == "recording-0001.mcap: no message is in it"
