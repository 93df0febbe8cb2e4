"""A lease's public name: states tell whose lease it is without giving away the token that commands need."""

from __future__ import annotations

from functools import lru_cache
from hashlib import blake2s


@lru_cache(maxsize=64)
def lease_id(token: int) -> int:
    """32 bits of a digest of a lease's token (0 to 2⁶³ - 1); 0 where there is no lease.

    Two leases share an id once in 2³² times; the token cannot be had from it.
    """
    if not token:
        return 0
    return int.from_bytes(blake2s(token.to_bytes(8, "big"), digest_size=4).digest(), "big") or 1
