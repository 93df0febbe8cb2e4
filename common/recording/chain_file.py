"""Checks a recording by the chain of hashes in it: a whole one, or one that was cut off."""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from typing import BinaryIO

from common.errors import RecordingError
from common.recording.chain import BLOCK, CHAIN, ChainCheck, ChainLink, follow_chain, read_link

MAGIC = b"\x89MCAP0\r\n"
_RECORD = struct.Struct("<BQ")
_METADATA = 0x0C
_LINK = re.compile(rb"\x0c.{8}" + struct.pack("<I", len(CHAIN)) + CHAIN.encode(), re.DOTALL)
_LINK_BYTES = _RECORD.size + 4 + len(CHAIN)
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
    """The links, as far as the file's records can be followed. The stream stands behind the magic bytes.

    A file that was cut off has no link behind its last whole record. Where there is one, a record's length
    was changed: that is a damaged link too.
    """
    from mcap.data_stream import ReadDataStream
    from mcap.records import Metadata

    begin = at = behind = len(MAGIC)
    while at + _RECORD.size <= size:
        begin = at
        stream.seek(at)
        kind, length = _RECORD.unpack(stream.read(_RECORD.size))
        at += _RECORD.size + length
        if at > size:
            break
        if kind != _METADATA or length > _LONGEST:
            continue
        try:
            record = Metadata.read(ReadDataStream(BytesIO(stream.read(length))))
        except Exception:  # a damaged record raises what struct and text decoding have
            yield None
            return
        if record.name == CHAIN:
            behind = at
            yield read_link(record.metadata)
    if any(found != begin for found in _records_of_links(stream, behind)):
        yield None


def _records_of_links(stream: BinaryIO, at: int) -> Iterator[int]:
    """Where records of links begin from there on, whatever the records before them say."""
    stream.seek(at)
    kept = b""
    while block := stream.read(BLOCK):
        data = kept + block
        yield from (at - len(kept) + found.start() for found in _LINK.finditer(data))
        at += len(block)
        kept = data[-_LINK_BYTES + 1 :]
