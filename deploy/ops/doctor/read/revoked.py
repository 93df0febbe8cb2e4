"""The revocation list that [link] names."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from common.errors import LinkError
from common.link.revoked import RevocationFile


@dataclass(frozen=True, slots=True)
class RevocationFacts:
    """What the file holds."""

    trouble: str = ""
    """Why it cannot be read; empty where it can."""
    names: frozenset[str] = frozenset()


def read_revoked(path: Path) -> RevocationFacts:
    """Reads it as the link itself does."""
    try:
        return RevocationFacts(names=RevocationFile(path).names)
    except LinkError as error:
        return RevocationFacts(str(error))
