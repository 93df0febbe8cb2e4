"""The messages between the two hosts of a trial: one request, one answer, checked on arrival. Pure.

Requests that take time (start, engage, stop) are answered at once with `busy`; the operator's host then looks
until they are done.
"""

from __future__ import annotations

from typing import Annotated, Literal, TypeVar

import msgpack
from pydantic import Field, TypeAdapter, ValidationError

from common.config.section import Section
from common.errors import CodecError
from common.wire.codec import MAX_PAYLOAD
from common.wire.topics import Priority, Topic

TALK = Topic("trial", "tandem/{robot}/trial", 0.0, 10.0, Priority.DATA, True, True, False)
"""The robot's host answers. Ten seconds, for a page of states over a slow link."""
_Message = TypeVar("_Message")
PAGE = 100
"""States in one answer: some 70 kB."""


class Start(Section):
    """Start a fresh slave."""

    do: Literal["start"] = "start"
    transport: str
    strategy: str
    max_age_s: float


class Look(Section):
    """Ask for the situation."""

    do: Literal["look"] = "look"


class Engage(Section):
    """Engage the robot beside you."""

    do: Literal["engage"] = "engage"
    operator: str


class Record(Section):
    """Keep the robot's messages from now on."""

    do: Literal["record"] = "record"


class EndRecording(Section):
    """End the recording."""

    do: Literal["take"] = "take"


class Page(Section):
    """Hand over the kept states from this number on."""

    do: Literal["page"] = "page"
    first: int = Field(ge=0)


class Stop(Section):
    """Stop the slave."""

    do: Literal["stop"] = "stop"


Request = Start | Look | Engage | Record | EndRecording | Page | Stop
_REQUEST: TypeAdapter[Request] = TypeAdapter(Annotated[Request, Field(discriminator="do")])


class TalkAnswer(Section):
    """The situation at the robot. Fields that a request does not concern stay at their defaults."""

    taken: bool = True
    """Whether the request was accepted; if not, `fault` gives the reason."""
    busy: bool = False
    """The last request is still being carried out."""
    fault: str = ""
    """Why the last request failed, sent once; or why the slave ended."""
    port: int = 0
    """Where the slave listens; 0 while there is none."""
    guard: str = ""
    reason: str = ""
    taking: bool = False
    """Whether the robot holds and takes the operator's commands: it may be engaged."""
    total: int = 0
    """States kept."""
    states: list[bytes] = Field(default_factory=list)
    statistics: list[bytes] = Field(default_factory=list)
    """With the first page."""
    cpu_percent: float = 0.0


_ANSWER = TypeAdapter(TalkAnswer)


def pack(message: Request | TalkAnswer) -> bytes:
    """Its bytes."""
    out: bytes = msgpack.packb(message.model_dump())
    return out


def read_request(payload: bytes) -> Request:
    """Raises CodecError for what is not a request."""
    return _valid(_REQUEST, payload)


def read_answer(payload: bytes) -> TalkAnswer:
    """Raises CodecError for what is not an answer."""
    return _valid(_ANSWER, payload)


def _valid(kind: TypeAdapter[_Message], payload: bytes) -> _Message:
    table = _table(payload)
    try:
        return kind.validate_python(table)
    except ValidationError as error:
        first = error.errors()[0]
        raise CodecError(f"{'.'.join(map(str, first['loc'])) or 'message'}: {first['msg']}") from None


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
