"""The files of one recording, in order, from any instant on."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from common.recording.reader import RecordingStream
from deploy.recorded.recompute import Recorded
from master.journal.calls import SNAPSHOT


def head_of(path: Path) -> Mapping[str, str]:
    """What the head of a file says. Raises RecordingError."""
    stream = RecordingStream(path)
    for _ in stream:
        break
    return stream.metadata or {}


def begun_ns(path: Path) -> int:
    """When its first message was measured, ns of the recording host's monotonic clock; 0 without one."""
    return next((entry.monotonic_ns for entry in RecordingStream(path)), 0)


def snapshot_ns(files: Sequence[Path], before_ns: int) -> int:
    """When the last snapshot before that time was taken; 0 where there is none."""
    found_ns = 0
    for path in files:
        for entry in RecordingStream(path):
            if entry.monotonic_ns > before_ns:
                return found_ns
            if entry.topic == SNAPSHOT:
                found_ns = entry.monotonic_ns
    return found_ns


def entries_of(files: Sequence[Path], from_ns: int, until_ns: int | None = None) -> Iterator[Recorded]:
    """All messages between two instants, in the files' order."""
    for path in files:
        for entry in RecordingStream(path):
            if entry.monotonic_ns >= from_ns and (until_ns is None or entry.monotonic_ns <= until_ns):
                yield Recorded(entry.topic, entry.payload)
