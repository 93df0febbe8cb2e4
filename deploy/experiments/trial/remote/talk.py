"""What the two hosts of a trial say to each other: one question, one answer, checked on arrival. Pure.

What takes time (start, engage, stop) is answered at once with `busy`; whoever asked looks until it is over.
"""

from __future__ import annotations

from typing import Literal

import msgpack
from pydantic import Field, ValidationError

from common.config.section import Section
from common.errors import CodecError
from common.wire.codec import MAX_PAYLOAD
from common.wire.topics import Priority, Topic

TALK = Topic("trial", "tandem/{robot}/trial", 0.0, 10.0, Priority.DATA, True, True, False)
"""The robot's host answers. Ten seconds, for a page of states over a slow link."""
PAGE = 100
"""States in one answer: some 70 kB."""


class Start(Section):
    """Start a fresh slave."""

    do: Literal["start"] = "start"
    transport: str
    strategy: str
    max_age_s: float


class Look(Section):
    """Ask how it stands."""

    do: Literal["look"] = "look"


class Engage(Section):
    """The operator's act, for the robot beside you."""

    do: Literal["engage"] = "engage"
    operator: str


class Record(Section):
    """Keep what the robot says from now on."""

    do: Literal["record"] = "record"


class EndRecording(Section):
    """Keep nothing more."""

    do: Literal["take"] = "take"


class Page(Section):
    """Hand over what was kept, from this number on."""

    do: Literal["page"] = "page"
    first: int = Field(ge=0)


class Stop(Section):
    """Stop the slave."""

    do: Literal["stop"] = "stop"


Request = Start | Look | Engage | Record | EndRecording | Page | Stop
REQUESTS: dict[str, type[Request]] = {
    "start": Start,
    "look": Look,
    "engage": Engage,
    "record": Record,
    "take": EndRecording,
    "page": Page,
    "stop": Stop,
}


class TalkAnswer(Section):
    """How it stands. Fields that a question does not concern stay at their defaults."""

    taken: bool = True
    """Whether the question was; if not, `fault` says why."""
    busy: bool = False
    """Something that was asked for is still under way."""
    fault: str = ""
    """Why what was asked for last did not come about, told once; or why the slave is gone."""
    port: int = 0
    """Where the slave listens; 0 while there is none."""
    guard: str = ""
    reason: str = ""
    taking: bool = False
    """Whether the robot holds and takes the operator's commands: it may be engaged."""
    total: int = 0
    """States kept."""
    states: list[bytes] = Field(default_factory=list)
    told: list[bytes] = Field(default_factory=list)
    """With the first page."""
    cpu_percent: float = 0.0


def pack(message: Request | TalkAnswer) -> bytes:
    """Its bytes."""
    out: bytes = msgpack.packb(message.model_dump())
    return out


def read_request(payload: bytes) -> Request:
    """Raises CodecError for what is none."""
    table = _table(payload)
    kind = REQUESTS.get(str(table.get("do")))
    if kind is None:
        raise CodecError(f"no such request; expected one of {', '.join(REQUESTS)}")
    try:
        return kind.model_validate(table)
    except ValidationError as error:
        raise CodecError(_short(error)) from None


def read_answer(payload: bytes) -> TalkAnswer:
    """Raises CodecError for what is none."""
    try:
        return TalkAnswer.model_validate(_table(payload))
    except ValidationError as error:
        raise CodecError(_short(error)) from None


def _table(payload: bytes) -> dict[str, object]:
    if len(payload) > MAX_PAYLOAD:
        raise CodecError(f"{len(payload)} bytes, expected at most {MAX_PAYLOAD}")
    try:
        table = msgpack.unpackb(payload, max_array_len=10 * PAGE, max_map_len=100)
    except Exception as error:  # msgpack raises ValueError, TypeError and its own family on garbage
        raise CodecError(f"not msgpack: {type(error).__name__}") from None
    if not isinstance(table, dict):
        raise CodecError("not a table")
    return table


def _short(error: ValidationError) -> str:
    first = error.errors()[0]
    return f"{'.'.join(map(str, first['loc'])) or 'message'}: {first['msg']}"
