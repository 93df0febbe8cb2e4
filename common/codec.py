"""Messages as msgpack arrays that begin with kind and schema version, checked on arrival.

Pure: bytes in, messages out. The only error decoding raises is CodecError.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, TypeVar

import msgpack
import numpy as np

from common.errors import CodecError
from common.messages import (
    Action,
    ClockQuery,
    ClockReply,
    Command,
    CommandEcho,
    CommandStamps,
    ControlReply,
    ControlRequest,
    Mask,
    Message,
    RobotState,
    Statistics,
    Truth,
)
from common.quaternion import Array

VERSION = 1
MAX_NAME = 64
MAX_TEXT = 512
ANGLE_LIMIT_RAD = 4 * math.pi
"""No joint turns twice round; a larger angle is a fault, not a posture."""
RATE_LIMIT_RAD_S = 100.0
_U63 = (1 << 63) - 1

_pack = msgpack.Packer(autoreset=True).pack
_Decoded = TypeVar("_Decoded")


def encode(message: Message) -> bytes:
    """The message's bytes. Positions and rates travel as float32: 1e-7 of a turn, half the size."""
    kind, pack = _ENCODERS[type(message)]
    out: bytes = _pack((kind, VERSION, *pack(message)))
    return out


def decode(payload: bytes, kind: type[_Decoded], joints: int = 0) -> _Decoded:
    """The message of the expected kind with `joints` joints; CodecError says what is wrong with it."""
    name, unpack = _DECODERS[kind]
    try:
        fields = msgpack.unpackb(payload, use_list=False, max_array_len=64, max_map_len=4096)
    except Exception as error:  # msgpack raises ValueError, TypeError and its own family on garbage
        raise CodecError(f"not msgpack: {type(error).__name__}") from None
    if not isinstance(fields, tuple) or len(fields) < 2:
        raise CodecError("not an array")
    if fields[0] != name:
        raise CodecError(f"kind {_short(fields[0])}, expected {name}")
    if type(fields[1]) is not int or fields[1] != VERSION:
        raise CodecError(f"schema version {_short(fields[1])}, expected {VERSION}")
    message: _Decoded = unpack(fields[2:], joints)
    return message


# one pair of functions a message, in the order of messages.py


def _pack_command(m: Command) -> tuple[Any, ...]:
    s = m.stamps
    return (
        m.robot, m.lease, m.sequence, m.tick, s.sampled_ns, s.frames_in_ns, s.solved_ns, s.put_ns,
        m.deadman_held, _mask_bytes(m.valid), _float_bytes(m.position_rad), _float_bytes(m.velocity_rad_s),
    )  # fmt: skip


def _unpack_command(f: tuple[Any, ...], joints: int) -> Command:
    _length(f, 12)
    for i in range(1, 8):
        _integer(f[i])
    return Command(
        robot=_text(f[0], MAX_NAME),
        lease=f[1],
        sequence=f[2],
        tick=f[3],
        stamps=CommandStamps(f[4], f[5], f[6], f[7]),
        deadman_held=_flag(f[8]),
        valid=_mask(f[9], joints),
        position_rad=_floats(f[10], joints, ANGLE_LIMIT_RAD),
        velocity_rad_s=_floats(f[11], joints, RATE_LIMIT_RAD_S),
    )


def _pack_state(m: RobotState) -> tuple[Any, ...]:
    e = m.echo
    echo = None if e is None else (e.sequence, e.put_ns, e.received_ns, e.accepted_ns, e.written_ns)
    return (
        m.robot, m.sequence, m.sent_ns, m.encoder_ns, m.guard, m.reason[:MAX_TEXT], m.operator,
        _mask_bytes(m.encoder_valid), _float_bytes(m.position_rad), _float_bytes(m.setpoint_rad), echo,
        m.master_offset_ns, m.offset_bound_ns,
    )  # fmt: skip


def _unpack_state(f: tuple[Any, ...], joints: int) -> RobotState:
    _length(f, 13)
    echo = f[10]
    if echo is not None:
        if not isinstance(echo, tuple):
            raise CodecError("echo is not an array")
        _length(echo, 5)
        echo = CommandEcho(*(_integer(x) for x in echo))
    return RobotState(
        robot=_text(f[0], MAX_NAME),
        sequence=_integer(f[1]),
        sent_ns=_integer(f[2]),
        encoder_ns=_integer(f[3]),
        guard=_text(f[4], MAX_NAME),
        reason=_text(f[5], MAX_TEXT),
        operator=_text(f[6], MAX_NAME),
        encoder_valid=_mask(f[7], joints),
        position_rad=_floats(f[8], joints, ANGLE_LIMIT_RAD),
        setpoint_rad=_floats(f[9], joints, ANGLE_LIMIT_RAD),
        echo=echo,
        master_offset_ns=_signed(f[11]),
        offset_bound_ns=_signed(f[12]),
    )


def _pack_control_request(m: ControlRequest) -> tuple[Any, ...]:
    return (m.robot, m.action.value, m.operator, m.key)


def _unpack_control_request(f: tuple[Any, ...], _: int) -> ControlRequest:
    _length(f, 4)
    try:
        action = Action(_text(f[1], MAX_NAME))
    except ValueError:
        raise CodecError(f"action {_short(f[1])}, expected one of {', '.join(Action)}") from None
    return ControlRequest(_text(f[0], MAX_NAME), action, _text(f[2], MAX_NAME), _text(f[3], MAX_TEXT))


def _pack_control_reply(m: ControlReply) -> tuple[Any, ...]:
    return (m.done, m.guard, m.text[:MAX_TEXT], m.lease)


def _unpack_control_reply(f: tuple[Any, ...], _: int) -> ControlReply:
    _length(f, 4)
    return ControlReply(_flag(f[0]), _text(f[1], MAX_NAME), _text(f[2], MAX_TEXT), _integer(f[3]))


def _pack_clock_query(m: ClockQuery) -> tuple[Any, ...]:
    return (m.asked_ns, m.last_asked_ns, m.last_heard_ns)


def _unpack_clock_query(f: tuple[Any, ...], _: int) -> ClockQuery:
    _length(f, 3)
    return ClockQuery(*(_integer(x) for x in f))


def _pack_clock_reply(m: ClockReply) -> tuple[Any, ...]:
    return (m.asked_ns, m.received_ns, m.replied_ns)


def _unpack_clock_reply(f: tuple[Any, ...], _: int) -> ClockReply:
    _length(f, 3)
    return ClockReply(*(_integer(x) for x in f))


def _pack_statistics(m: Statistics) -> tuple[Any, ...]:
    return (m.role, m.sent_ns, m.figures)


def _unpack_statistics(f: tuple[Any, ...], _: int) -> Statistics:
    _length(f, 3)
    if not isinstance(f[2], dict):
        raise CodecError("figures are not a map")
    return Statistics(_text(f[0], MAX_NAME), _integer(f[1]), f[2])


def _pack_truth(m: Truth) -> tuple[Any, ...]:
    return (m.tick, m.sampled_ns, _float_bytes(m.position_rad), _float_bytes(m.velocity_rad_s))


def _unpack_truth(f: tuple[Any, ...], joints: int) -> Truth:
    _length(f, 4)
    position = _floats(f[2], joints, ANGLE_LIMIT_RAD)
    return Truth(_integer(f[0]), _integer(f[1]), position, _floats(f[3], joints, RATE_LIMIT_RAD_S))


_ENCODERS: dict[type, tuple[str, Callable[[Any], tuple[Any, ...]]]] = {
    Command: ("command", _pack_command),
    RobotState: ("state", _pack_state),
    ControlRequest: ("control", _pack_control_request),
    ControlReply: ("controlled", _pack_control_reply),
    ClockQuery: ("clock", _pack_clock_query),
    ClockReply: ("clocked", _pack_clock_reply),
    Statistics: ("statistics", _pack_statistics),
    Truth: ("truth", _pack_truth),
}
_DECODERS: dict[type, tuple[str, Callable[[tuple[Any, ...], int], Any]]] = {
    Command: ("command", _unpack_command),
    RobotState: ("state", _unpack_state),
    ControlRequest: ("control", _unpack_control_request),
    ControlReply: ("controlled", _unpack_control_reply),
    ClockQuery: ("clock", _unpack_clock_query),
    ClockReply: ("clocked", _unpack_clock_reply),
    Statistics: ("statistics", _unpack_statistics),
    Truth: ("truth", _unpack_truth),
}


# checks of single fields


def _float_bytes(values: Array) -> bytes:
    return values.astype("<f4").tobytes()


def _floats(value: object, count: int, limit: float) -> Array:
    if type(value) is not bytes or len(value) != 4 * count:
        raise CodecError(f"not {count} float32 values")
    out = np.frombuffer(value, "<f4").astype(np.float64)
    # one comparison refuses NaN and infinity too
    if not (np.abs(out) <= limit).all():
        raise CodecError(f"a value is not finite, or beyond ±{limit:g}")
    return out


def _mask_bytes(mask: Mask) -> bytes:
    return np.packbits(mask, bitorder="little").tobytes()


def _mask(value: object, count: int) -> Mask:
    if type(value) is not bytes or len(value) != (count + 7) // 8:
        raise CodecError(f"not a mask of {count} bits")
    return np.unpackbits(np.frombuffer(value, np.uint8), count=count, bitorder="little").view(np.bool_)


def _length(fields: tuple[Any, ...], count: int) -> None:
    if len(fields) != count:
        raise CodecError(f"{len(fields)} fields, expected {count}")


def _integer(value: Any) -> int:
    if type(value) is not int or not 0 <= value <= _U63:
        raise CodecError(f"{_short(value)} is not a 63-bit count")
    return value


def _signed(value: Any) -> int:
    if type(value) is not int or not -_U63 <= value <= _U63:
        raise CodecError(f"{_short(value)} is not a 64-bit integer")
    return value


def _flag(value: Any) -> bool:
    if type(value) is not bool:
        raise CodecError(f"{_short(value)} is not a flag")
    return value


def _text(value: Any, most: int) -> str:
    if type(value) is not str or len(value) > most:
        raise CodecError(f"{_short(value)} is not a text of at most {most} characters")
    return value


def _short(value: object) -> str:
    return repr(value)[:40]
