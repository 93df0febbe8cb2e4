"""A CAN frame as the pure code sees it; only `bus` knows python-can's messages."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class CanFrame:
    """One data frame with an 11-bit identifier; up to 8 bytes on classic CAN, up to 64 where `fd`."""

    id: int
    data: bytes
    fd: bool
