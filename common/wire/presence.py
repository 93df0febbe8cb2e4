"""Who is there, as a liveliness token's key tells it: role, process, version and place. Pure.

Each process shows two tokens. `alive/{role}` alone is the form of schema 2, which every version reads;
`alive/{role}/{instance}/{version}/{place}` tells the rest, so that two processes of one name, or of two
versions, are told apart before any message is read. Neither form ever changes.
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
    """One process that shows itself."""

    robot: str
    role: str
    """`slave` or `master`."""
    instance: int = 0
    """0 where only the short form came: a process of schema 2, or the other token of one that is known."""
    schema: int = 0
    """Of its messages; 0 where it did not tell."""
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
        """What to say where its messages are of another version than this process's; empty where not."""
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
    """What a token's key tells; None where it is no token of tandem's. It raises on no key."""
    parts = key.split("/")
    if len(parts) < 4 or parts[0] != "tandem" or parts[2] != "alive":
        return None
    robot, role, more = parts[1], parts[3], parts[4:]
    if not more:
        return ProcessPresence(robot, role)
    try:
        instance = int(more[0], 16)
        schema, _, software = more[1].partition("-")
        # what a later version appends to the key is let be
        return ProcessPresence(robot, role, instance, int(schema), unquote(software), unquote(more[2]))
    except (ValueError, IndexError):
        return None


def place(endpoints: Sequence[str]) -> str:
    """Where this process is, in words."""
    host = platform.node() or "a host without a name"
    return f"{host}, {', '.join(endpoints)}" if endpoints else host


def present(robot: str, role: str, instance: int, endpoints: Sequence[str]) -> ProcessPresence:
    """How a process shows itself."""
    return ProcessPresence(robot, role, instance, SCHEMA, installed("tandem"), place(endpoints))


def several_bear(robot: str, places: Sequence[str]) -> str:
    """What to say where several processes bear one robot's name."""
    where = " and ".join(sorted(places))
    return f"{len(places)} robots bear the name {robot}: {where}. Give each its own (`robot` in its file)"
