"""What master and slave need of a `TapSender`; a test gives them another."""

from __future__ import annotations

from typing import Protocol


class Readers(Protocol):
    """Those who read the tap."""

    @property
    def read(self) -> bool:
        """Whether anybody reads everything."""

    @property
    def behind(self) -> bool:
        """Whether one who reads lacks messages."""

    def put(self, topic: str, payload: bytes, stamp_ns: int | None = None) -> None:
        """Hand one message to all readers that want it."""

    def put_snapshot(self, topic: str, payload: bytes) -> None:
        """Hand on what a reader that lacks messages must know."""
