"""A CAN frame as the pure code sees it; only `bus` knows python-can's messages."""

from __future__ import annotations

from dataclasses import dataclass

EXTENDED = 0x8000_0000
"""Added to an identifier of 29 bits, as in a DBC: so that it differs from the same number in 11 bits."""


@dataclass(frozen=True, slots=True)
class CanFrame:
    """One frame; up to 8 bytes on classic CAN, up to 64 where `fd`.

    An identifier has 11 bits, or 29 and `EXTENDED`.
    """

    id: int
    data: bytes
    fd: bool
    remote: bool = False
    """True: a request for the frame of this identifier, without data."""
