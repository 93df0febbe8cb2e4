"""A lease's short name, for states: a digest of the token that commands bear.

It keeps the token from who hears states alone. Who hears commands has it: what protects the robot from them
is `[link.access]`, by which only its operators may publish commands.
"""

from __future__ import annotations

from functools import lru_cache
from hashlib import blake2s


@lru_cache(maxsize=64)
def lease_id(token: int) -> int:
    """32 bits of a digest of a lease's token (0 to 2⁶³ - 1); 0 where there is no lease.

    Two leases share an id once in 2³² times; the token cannot be computed from it.
    """
    if not token:
        return 0
    return int.from_bytes(blake2s(token.to_bytes(8, "big"), digest_size=4).digest(), "big") or 1
