"""Roles in certificates: the common name of each is `role:name`, such as `operator:nurse-1`. Pure."""

from __future__ import annotations

from enum import StrEnum


class Role(StrEnum):
    """What a certificate's holder is."""

    OPERATOR = "operator"
    """Commands robots, from the master or by the operator's commands."""
    ROBOT = "robot"
    """Publishes its own state and video, and answers."""
    OBSERVER = "observer"
    """Receives only; named under `observers` or, with video, `viewers`."""
    ROUTER = "router"
    """Forwards what others may send."""


def common_name(role: Role, name: str) -> str:
    """As Zenoh's access control compares it, letter by letter."""
    return f"{role}:{name}"


def role_of(common_name: str) -> tuple[Role, str]:
    """Role and name. Raises ValueError for a common name that holds neither."""
    role, colon, name = common_name.partition(":")
    if not colon or not name or role not in list(Role):
        raise ValueError(f"expected a common name such as operator:nurse-1, not {common_name!r}")
    return Role(role), name
