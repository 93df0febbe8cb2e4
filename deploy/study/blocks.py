"""A file in blocks, so that a changed byte can be placed: an MCAP file by its chunks, others by 64 kB."""

from __future__ import annotations

import hashlib
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

BLOCK = 65_536
MAGIC = b"\x89MCAP0\r\n"
_RECORD = struct.Struct("<BQ")
_CHUNK = 0x06
_TIMES = struct.Struct("<QQ")


@dataclass(frozen=True, slots=True)
class Block:
    """A part of a file."""

    offset: int
    length: int
    sha256: str
    times_ns: tuple[int, int] | None = None
    """Of an MCAP chunk: its first and last message, ns since 1970."""


def blocks_of(path: Path) -> list[Block]:
    """All blocks of a file, without a gap. Raises OSError."""
    size = path.stat().st_size
    with path.open("rb") as stream:
        cuts = list(_chunks(path, size)) if stream.read(len(MAGIC)) == MAGIC else []
        edges = sorted({0, size, *(at for cut in cuts for at in (cut[0], cut[1]))})
        times = {cut[0]: cut[2] for cut in cuts}
        found = []
        for begin, end in pairwise(edges):
            # what lies between two chunks may be long too: the index at the end
            step = end - begin if begin in times else BLOCK
            for offset in range(begin, end, step):
                length = min(step, end - offset)
                stream.seek(offset)
                digest = hashlib.sha256(stream.read(length)).hexdigest()
                found.append(Block(offset, length, digest, times.get(offset)))
    return found


def _chunks(path: Path, size: int) -> Iterator[tuple[int, int, tuple[int, int]]]:
    """Begin, end and times of each chunk, as far as the file's records can be followed."""
    with path.open("rb") as stream:
        at = len(MAGIC)
        while at + _RECORD.size <= size:
            stream.seek(at)
            kind, length = _RECORD.unpack(stream.read(_RECORD.size))
            end = at + _RECORD.size + length
            if end > size:
                return
            if kind == _CHUNK and length >= _TIMES.size:
                first, last = _TIMES.unpack(stream.read(_TIMES.size))
                yield at, end, (first, last)
            at = end
