"""Reads a recording back, as far as it is whole."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

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
class Recording:
    """A file's content, in the order in which it was written."""

    metadata: dict[str, str]
    entries: list[Entry]
    cut: str
    """How it ends too early; empty where it was closed in order."""


def read_recording(path: Path) -> Recording:
    """Read a whole file, or one that was cut off, up to its last whole chunk.

    Raises RecordingError where it cannot be opened or is no recording of ours.
    """
    from mcap.exceptions import InvalidMagic
    from mcap.records import Channel, Message, Metadata
    from mcap.stream_reader import StreamReader

    metadata: dict[str, str] | None = None
    topics: dict[int, str] = {}
    entries: list[Entry] = []
    cut = ""
    try:
        with path.open("rb") as stream:
            try:
                for record in StreamReader(stream, validate_crcs=True).records:
                    if isinstance(record, Message):
                        topic = topics[record.channel_id]
                        entries.append(Entry(topic, record.data, record.log_time, record.publish_time))
                    elif isinstance(record, Channel):
                        topics[record.id] = record.topic
                    elif isinstance(record, Metadata) and record.name == METADATA:
                        metadata = dict(record.metadata)
            except InvalidMagic:
                if stream.tell() <= 8:
                    raise RecordingError(f"{path}: not an MCAP file") from None
                cut = "its last bytes are not MCAP's"
            except Exception as error:  # a torn end looks like anything: no end of file, bad CRC, zstd's own
                cut = f"it was cut off ({type(error).__name__})"
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read ({error.strerror or error})") from None
    if metadata is None:
        raise RecordingError(f"{path}: not a recording of tandem, or cut off at its very beginning")
    return Recording(metadata, entries, cut)
