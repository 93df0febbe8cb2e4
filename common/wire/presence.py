"""Which processes are alive, from the keys of their liveliness tokens: role, instance, version, place. Pure.

Each process shows two tokens. `alive/{role}` alone is the form of schema 2, which every version reads;
`alive/{role}/{instance}/{version}/{place}` holds the rest, so that two processes of one name, or of two
versions, are distinguished before any message is read. Neither form ever changes.
"""

from __future__ import annotations

import platform
from collections.abc import Sequence
from dataclasses import dataclass
from urllib.parse import quote, unquote

from common.wire.codec import VERSION as SCHEMA
from common.wire.topics import ALIVE
from common.wire.version import installed

_MOST_PLACE = 160


@dataclass(frozen=True, slots=True)
class ProcessPresence:
    """One process that is alive."""

    robot: str
    role: str
    """`slave` or `master`."""
    instance: int = 0
    """0 where only the short form came: a process of schema 2, or the other token of one that is known."""
    schema: int = 0
    """Of its messages; 0 where it is not known."""
    software: str = ""
    """Its tandem's version."""
    place: str = ""
    """Host and endpoints, in words."""

    @property
    def key(self) -> str:
        """The token's key."""
        short = f"{ALIVE.key_for(self.robot)}/{self.role}"
        if not self.instance:
            return short
        version = f"{self.schema}-{quote(self.software, safe='')}"
        return f"{short}/{self.instance:08x}/{version}/{quote(self.place[:_MOST_PLACE], safe=': ,') or '-'}"

    @property
    def other_version(self) -> str:
        """Why this process cannot read its messages, and what to do; empty if it can."""
        if not self.instance or self.schema == SCHEMA:
            return ""
        return (
            f"the {self.role} at {self.words} runs tandem {self.software} with messages of schema "
            f"{self.schema}, this is tandem {installed('tandem')} with schema {SCHEMA}: but for a stop they "
            "do not understand each other. Install the same tandem on both hosts"
        )

    @property
    def words(self) -> str:
        """For people: where it is, and its number."""
        where = self.place or "an unknown place"
        return f"{where} (instance {self.instance:08x})" if self.instance else where


def read_presence(key: str) -> ProcessPresence | None:
    """The process that a token's key describes; None for a key that is no token of tandem. Never raises."""
    parts = key.split("/")
    if len(parts) < 4 or parts[0] != "tandem" or parts[2] != "alive":
        return None
    robot, role, more = parts[1], parts[3], parts[4:]
    if not more:
        return ProcessPresence(robot, role)
    try:
        instance = int(more[0], 16)
        schema, _, software = more[1].partition("-")
        # a later version may append to the key
        return ProcessPresence(robot, role, instance, int(schema), unquote(software), unquote(more[2]))
    except (ValueError, IndexError):
        return None


def place(endpoints: Sequence[str]) -> str:
    """Where this process is, in words."""
    host = platform.node() or "a host without a name"
    return f"{host}, {', '.join(endpoints)}" if endpoints else host


def present(robot: str, role: str, instance: int, endpoints: Sequence[str]) -> ProcessPresence:
    """The presence of this process, for its token."""
    return ProcessPresence(robot, role, instance, SCHEMA, installed("tandem"), place(endpoints))


def several_bear(robot: str, places: Sequence[str]) -> str:
    """The message that several robots have one name, and what to do."""
    where = " and ".join(sorted(places))
    return (
        f"{len(places)} robots have the name {robot}: {where}. Give each its own name (`robot` in its file)"
    )
