"""Several robots moved by one operator at once: only by a deliberate act. Pure.

While one robot follows an operator, the operator's master advises in its commands to the others against an
engage. An engage whose key is TOGETHER is that deliberate act: it passes over this advice, and no other.
"""

from __future__ import annotations

from collections.abc import Sequence

TOGETHER = "together"
_BEGINS = "the operator already moves "


def beside(robots: Sequence[str]) -> str:
    """The doubt in the commands to all other robots; empty where none moves."""
    if not robots:
        return ""
    return f"{_BEGINS}{', '.join(robots)}: to move several robots at once, engage with --together"


def only_beside(doubt: str) -> bool:
    """Whether nothing but that speaks against an engage."""
    return doubt.startswith(_BEGINS)
