"""Checks a recording by the chain of hashes in it: a whole one, or one that was cut off."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from typing import BinaryIO

from common.errors import RecordingError
from common.recording.chain import CHAIN, ChainCheck, ChainLink, follow_chain, read_link

MAGIC = b"\x89MCAP0\r\n"
_RECORD = struct.Struct("<BQ")
_METADATA = 0x0C
_LONGEST = 10_000
"""Bytes of a link's record, and more: a longer one is none."""


def check_recording(path: Path) -> ChainCheck:
    """What the chain in a recording says of its bytes. Raises RecordingError where it cannot be read."""
    try:
        size = path.stat().st_size
        with path.open("rb") as stream, path.open("rb") as again:
            if stream.read(len(MAGIC)) != MAGIC:
                raise RecordingError(f"{path}: not an MCAP file")
            return follow_chain(_links(stream, size), again, size)
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read ({error.strerror or error})") from None


def _links(stream: BinaryIO, size: int) -> Iterator[ChainLink | None]:
    """The links, as far as the file's records can be followed. The stream stands behind the magic bytes."""
    from mcap.data_stream import ReadDataStream
    from mcap.records import Metadata

    at = len(MAGIC)
    while at + _RECORD.size <= size:
        stream.seek(at)
        kind, length = _RECORD.unpack(stream.read(_RECORD.size))
        at += _RECORD.size + length
        if at > size:
            return
        if kind != _METADATA or length > _LONGEST:
            continue
        try:
            record = Metadata.read(ReadDataStream(BytesIO(stream.read(length))))
        except Exception:  # a damaged record raises what struct and text decoding have
            yield None
            return
        if record.name == CHAIN:
            yield read_link(record.metadata)
