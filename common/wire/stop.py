"""The emergency stop on the wire. Its bytes never change: every version of tandem understands every other.

The form is the request and the answer of schema 2, the first that was deployed; `common.wire.codec` and its
version have no part in it. Requests are read leniently (a robot stops on doubt), answers strictly (a person
is told "stopped" only for certain). Pure; nothing here raises on any bytes.

request: msgpack [kind "control", 2, robot, "estop", operator, "", 0, 0]
answer:  msgpack [kind "controlled", 2, done, guard's state, text, instance, 0]
"""

from __future__ import annotations

from dataclasses import dataclass

import msgpack

_FORM = 2
_MAX_BYTES = 64 * 1024
_MAX_NAME = 64
_MAX_TEXT = 512
STOPPED = "estop"
"""The guard's state of a robot that is stopped."""


@dataclass(frozen=True, slots=True)
class StopAnswer:
    """A robot's answer to a stop."""

    done: bool
    guard: str
    text: str
    instance: int = 0
    """Which process it is that answers; 0 from a robot of schema 2, which has no instance number."""

    @property
    def stopped(self) -> bool:
        """Whether the robot reports that it is stopped."""
        return self.done and self.guard == STOPPED


def pack_stop(robot: str, operator: str) -> bytes:
    """The request's bytes. Every text can be packed; too long a one is cut."""
    out: bytes = msgpack.packb([
        "control", _FORM, _text(robot, _MAX_NAME), STOPPED, _text(operator, _MAX_NAME), "", 0, 0,
    ])  # fmt: skip
    return out


def read_stop(payload: bytes) -> str | None:
    """Who asks for a stop (may be empty); None where the bytes are no stop.

    Whatever the version, and whatever follows: an array of kind "control" whose action is "estop".
    """
    array = _array(payload)
    if array is None or len(array) < 4 or array[0] != "control" or array[3] != STOPPED:
        return None
    who = array[4] if len(array) > 4 else ""
    return _text(who, _MAX_NAME) if isinstance(who, str) else ""


def pack_stop_answer(answer: StopAnswer) -> bytes:
    """The answer's bytes."""
    out: bytes = msgpack.packb([
        "controlled", _FORM, answer.done, _text(answer.guard, _MAX_NAME), _text(answer.text, _MAX_TEXT),
        answer.instance, 0,
    ])  # fmt: skip
    return out


def read_stop_answer(payload: bytes) -> StopAnswer | None:
    """The answer; None where the bytes are none, byte for byte as laid down."""
    array = _array(payload)
    if array is None or len(array) != 7 or array[0] != "controlled" or array[1] != _FORM:
        return None
    done, guard, text, instance = array[2:6]
    if type(done) is not bool or type(guard) is not str or type(text) is not str:
        return None
    if type(instance) is not int or instance < 0:
        return None
    return StopAnswer(done, guard, text, instance)


def _array(payload: bytes) -> list[object] | None:
    if len(payload) > _MAX_BYTES:
        return None
    try:
        array = msgpack.unpackb(payload, unicode_errors="replace", strict_map_key=False)
    except Exception:  # msgpack raises ValueError, TypeError and its own family on garbage
        return None
    return array if isinstance(array, list) else None


def _text(text: str, most: int) -> str:
    return text[:most].encode("utf-8", "replace").decode("utf-8")
