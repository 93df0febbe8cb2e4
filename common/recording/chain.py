"""The chain of hashes that a recorder writes into its file as it goes. Pure.

    h₀ = SHA-256("tandem chain 1");   hₖ = SHA-256(hₖ₋₁ ‖ the file's bytes since the link before)

Each link is a metadata record that names where its bytes end, and hₖ. The bytes of a link's own record
belong to the next one. So a file that was cut off can be checked up to its last link, and a changed byte
before it is found. Whoever can write the file can write another chain: a head that was noted elsewhere is
what proves it.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import BinaryIO

CHAIN = "tandem-chain"
"""Name of the metadata records."""
BLOCK = 1 << 20
_FIRST = hashlib.sha256(b"tandem chain 1").digest()


@dataclass(frozen=True, slots=True)
class ChainLink:
    """One link: the bytes of the file before `end`, back to the link before."""

    end: int
    head: str

    def record(self) -> dict[str, str]:
        """As it stands in the file."""
        return {"end": str(self.end), "head": self.head}


class RunningChain:
    """Takes the file's bytes as they are written, and makes a link whenever it is asked for one."""

    def __init__(self) -> None:
        self._head = _FIRST
        self._since = hashlib.sha256(_FIRST)
        self._end = 0

    def take(self, data: bytes | memoryview) -> None:
        """The next bytes of the file."""
        self._since.update(data)
        self._end += len(data)

    def link(self) -> ChainLink:
        """Close what was taken since the last one."""
        self._head = self._since.digest()
        self._since = hashlib.sha256(self._head)
        return ChainLink(self._end, self._head.hex())


@dataclass(frozen=True, slots=True)
class ChainCheck:
    """What a file's own chain says of it."""

    links: int
    sealed: int
    """Bytes from the file's beginning that the chain vouches for."""
    size: int
    head: str
    """Of the newest link that holds; empty where there is none."""
    broken: str = ""
    """Where the chain does not hold, in words."""


def read_link(record: Mapping[str, str]) -> ChainLink | None:
    """A link from its record; None where it is damaged."""
    try:
        return ChainLink(int(record["end"]), record["head"])
    except (KeyError, ValueError):
        return None


def follow_chain(links: Iterable[ChainLink | None], file: BinaryIO, size: int) -> ChainCheck:
    """Hash the file again along its links, in their order."""
    running, count, head, sealed = RunningChain(), 0, "", 0
    for link in links:
        if link is None or not sealed <= link.end <= size:
            return ChainCheck(count, sealed, size, head, f"link {count + 1} is damaged")
        file.seek(sealed)
        left = link.end - sealed
        while left and (block := file.read(min(left, BLOCK))):
            running.take(block)
            left -= len(block)
        if running.link().head != link.head:
            return ChainCheck(count, sealed, size, head, f"bytes {sealed} to {link.end - 1} were changed")
        count, head, sealed = count + 1, link.head, link.end
    return ChainCheck(count, sealed, size, head)
