"""Reads a recording back, as far as it is whole."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, NamedTuple

from common.errors import RecordingError
from common.recording.recorder import METADATA


class Entry(NamedTuple):
    """One recorded message."""

    topic: str
    payload: bytes
    wall_ns: int
    """When it was handed over, ns since 1970."""
    monotonic_ns: int
    """The recording host's monotonic clock when it was measured."""


@dataclass(frozen=True, slots=True)
class McapRecording:
    """A file's content, in the order in which it was written."""

    metadata: dict[str, str]
    entries: list[Entry]
    cut: str
    """How it ends too early; empty where it was closed in order."""


class RecordingStream:
    """The entries of a file one after the other, in constant memory, as far as the file is whole.

    `metadata` and `cut` are known once it has been gone through. Going through it raises RecordingError
    where it cannot be opened or is no recording of tandem.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self.metadata: dict[str, str] | None = None
        self.cut = ""
        """How it ends too early; empty where it was closed in order."""

    def __iter__(self) -> Iterator[Entry]:
        try:
            with self._path.open("rb") as stream:
                yield from self._entries(stream)
        except OSError as error:
            raise RecordingError(f"{self._path}: cannot be read ({error.strerror or error})") from None
        if self.metadata is None:
            raise RecordingError(f"{self._path}: not a recording of tandem, or cut off at its very beginning")

    def _entries(self, stream: BinaryIO) -> Iterator[Entry]:
        from mcap.exceptions import InvalidMagic
        from mcap.records import Channel, Message, Metadata
        from mcap.stream_reader import StreamReader

        topics: dict[int, str] = {}
        records = iter(StreamReader(stream, validate_crcs=True).records)
        while True:
            try:
                record = next(records, None)
            except InvalidMagic:
                if stream.tell() <= 8:
                    raise RecordingError(f"{self._path}: not an MCAP file") from None
                self.cut = "its last bytes are not MCAP's"
                return
            except Exception as error:  # a torn end looks like anything: no end of file, bad CRC, zstd's own
                self.cut = f"it was cut off ({type(error).__name__})"
                return
            if record is None:
                return
            if isinstance(record, Message):
                topic = topics[record.channel_id]
                yield Entry(topic, record.data, record.log_time, record.publish_time)
            elif isinstance(record, Channel):
                topics[record.id] = record.topic
            elif isinstance(record, Metadata) and record.name == METADATA:
                self.metadata = dict(record.metadata)


def read_recording(path: Path) -> McapRecording:
    """Read a whole file, or one that was cut off, up to its last whole chunk.

    Raises RecordingError where it cannot be opened or is no recording of tandem.
    """
    stream = RecordingStream(path)
    entries = list(stream)
    return McapRecording(stream.metadata or {}, entries, stream.cut)
