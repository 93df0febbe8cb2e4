"""Which process it is: two robots may bear one name by mistake, but never one instance number."""

from __future__ import annotations

import secrets


def draw_instance() -> int:
    """A number, 1 to 2³² - 1, that no other process has but by a chance of one in four billion."""
    return 1 + secrets.randbelow(2**32 - 1)
