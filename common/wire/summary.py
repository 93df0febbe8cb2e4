"""What a robot tells everybody who may observe it, once a second: enough for a list, too little to command.

Who commands or opens a robot hears its state at 50 Hz beside it. A liveliness token carries nothing but its
key, so what changes travels here. It is published, not asked for: one message a second a robot, whoever and
however many listen, and routers copy it; a question would cost two messages a listener. Pure.
"""

from __future__ import annotations

from dataclasses import dataclass

import msgpack

from common.errors import CodecError
from common.wire import fields
from common.wire.fields import MAX_DOUBT, MAX_NAME

VERSION = 1
MOST_BYTES = 1000
"""It fits into one packet on every path."""
MOST_WORDS = 80
"""Characters of the words of a call."""
_MAX_S = 1e7


@dataclass(frozen=True, slots=True)
class HomeCall:
    """Somebody at the robot asks for an operator."""

    since_s: float
    """For how long, by the robot's clock when the summary was made."""
    words: str = ""


@dataclass(frozen=True, slots=True)
class RobotSummary:
    """One robot, at the moment at which it sent this."""

    robot: str
    instance: int
    sequence: int
    guard: str
    """Name of the guard's state."""
    reason: str
    operator: str = ""
    """Who holds the lease; empty: nobody."""
    offered_to: str = ""
    """To whom the holder offers it."""
    wanted_by: str = ""
    """Who has asked to command it, so that this operator's master claims it; empty: nobody, or long ago."""
    let_go_by: str = ""
    """Who gave the lease back last; empty once somebody has claimed it again."""
    faults: int = 0
    """How many things are wrong with its body."""
    call: HomeCall | None = None


def encode_summary(summary: RobotSummary) -> bytes:
    """The summary's bytes."""
    call = summary.call
    out: bytes = msgpack.packb((
        "summary", VERSION, summary.robot, summary.instance, summary.sequence, summary.guard,
        fields.shorten(summary.reason, MAX_DOUBT), summary.operator, summary.offered_to, summary.wanted_by,
        summary.let_go_by, summary.faults,
        None if call is None else (min(call.since_s, _MAX_S), call.words[:MOST_WORDS]),
    ))  # fmt: skip
    return out


def decode_summary(payload: bytes) -> RobotSummary:
    """The summary; what a later version appends is not read. Raises CodecError."""
    if len(payload) > MOST_BYTES:
        raise CodecError(f"{len(payload)} bytes, expected at most {MOST_BYTES}")
    try:
        array = msgpack.unpackb(payload, use_list=False, max_array_len=64)
    except Exception as error:  # msgpack raises ValueError, TypeError and its own family on garbage
        raise CodecError(f"not msgpack: {type(error).__name__}") from None
    if type(array) is not tuple or len(array) < 13 or array[0] != "summary":
        raise CodecError("not a summary")
    if array[1] != VERSION:
        raise CodecError(f"a summary of version {fields.short(array[1])}, expected {VERSION}")
    robot, instance, sequence, guard, reason, operator, offered_to, wanted_by, let_go_by, faults, call = (
        array[2:13]
    )
    return RobotSummary(
        fields.text(robot, MAX_NAME),
        fields.count(instance),
        fields.count(sequence),
        fields.text(guard, MAX_NAME),
        fields.text(reason, MAX_DOUBT),
        operator=fields.text(operator, MAX_NAME),
        offered_to=fields.text(offered_to, MAX_NAME),
        wanted_by=fields.text(wanted_by, MAX_NAME),
        let_go_by=fields.text(let_go_by, MAX_NAME),
        faults=fields.count(faults),
        call=None if call is None else _call(call),
    )


def _call(value: object) -> HomeCall:
    if type(value) is not tuple or len(value) < 2:
        raise CodecError(f"{fields.short(value)} is no call")
    return HomeCall(fields.number(value[0], 0.0, _MAX_S), fields.text(value[1], MOST_WORDS))
