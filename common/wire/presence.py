"""Which processes are alive, from the keys of their liveliness tokens: role, instance, version, place. Pure.

Each process shows two tokens. `alive/{role}` alone is the form of schema 2, which every version reads;
`alive/{role}/{instance}/{version}/{place}/{profile}` holds the rest, so that two processes of one name, or
of two versions, are distinguished before any message is read. Neither form ever changes; the profile was
appended later, and is missing where an older version runs.

An operator's master shows one more token, for it may command no robot at the moment:
`tandem/-/operator/{operator}/alive/{instance}/{version}/{place}`. `-` stands where a robot's name would: no
robot can bear it.
"""

from __future__ import annotations

import platform
import re
from collections.abc import Sequence
from dataclasses import dataclass
from urllib.parse import quote, unquote

from common.wire.codec import VERSION as SCHEMA
from common.wire.sender import operator_chunk, operator_of
from common.wire.topics import ALIVE
from common.wire.version import installed

ROBOT_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,63}")
"""Of a robot: what else stands in a key is no robot of tandem's, and no process may act on it."""
_MOST_PLACE = 160
_MOST_PROFILE = 64


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
    profile: str = ""
    """The skeleton profile of a robot; empty where it is not known."""

    @property
    def key(self) -> str:
        """The token's key."""
        short = f"{ALIVE.key_for(self.robot)}/{self.role}"
        if not self.instance:
            return short
        version = f"{self.schema}-{quote(self.software, safe='')}"
        place = quote(self.place[:_MOST_PLACE], safe=": ,") or "-"
        profile = f"/{quote(self.profile[:_MOST_PROFILE], safe='')}" if self.profile else ""
        return f"{short}/{self.instance:08x}/{version}/{place}{profile}"

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
    if not ROBOT_NAME.fullmatch(robot):
        return None
    if not more:
        return ProcessPresence(robot, role)
    try:
        instance = int(more[0], 16)
        schema, _, software = more[1].partition("-")
        # a later version may append to the key
        profile = unquote(more[3]) if len(more) > 3 else ""
        return ProcessPresence(
            robot, role, instance, int(schema), unquote(software), unquote(more[2]), profile
        )
    except (ValueError, IndexError):
        return None


def place(endpoints: Sequence[str]) -> str:
    """Where this process is, in words."""
    host = platform.node() or "a host without a name"
    return f"{host}, {', '.join(endpoints)}" if endpoints else host


def present(
    robot: str, role: str, instance: int, endpoints: Sequence[str], profile: str = ""
) -> ProcessPresence:
    """The presence of this process, for its token."""
    return ProcessPresence(robot, role, instance, SCHEMA, installed("tandem"), place(endpoints), profile)


@dataclass(frozen=True, slots=True)
class OperatorPresence:
    """The master of one operator, alive somewhere."""

    operator: str
    instance: int
    software: str = ""
    place: str = ""

    @property
    def key(self) -> str:
        """The token's key."""
        version = f"{SCHEMA}-{quote(self.software, safe='')}"
        place = quote(self.place[:_MOST_PLACE], safe=": ,") or "-"
        return f"{operator_alive_key(self.operator)}/{self.instance:08x}/{version}/{place}"


def operator_alive_key(operator: str) -> str:
    """The beginning of the keys of an operator's tokens; `*`: of every operator's."""
    return f"tandem/-/operator/{operator if operator == '*' else operator_chunk(operator)}/alive"


def read_operator_presence(key: str) -> OperatorPresence | None:
    """The operator whose token has that key; None for any other key. Never raises."""
    parts = key.split("/")
    if len(parts) < 8 or parts[:3] != ["tandem", "-", "operator"] or parts[4] != "alive":
        return None
    operator = operator_of("/".join(parts[:5]))
    try:
        software = unquote(parts[6].partition("-")[2])
        return OperatorPresence(operator or "", int(parts[5], 16), software, unquote(parts[7]))
    except ValueError:
        return None


def several_bear(robot: str, places: Sequence[str]) -> str:
    """The message that several robots have one name, and what to do."""
    where = " and ".join(sorted(places))
    return (
        f"{len(places)} robots have the name {robot}: {where}. Give each its own name (`robot` in its file)"
    )
