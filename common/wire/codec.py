"""Messages as msgpack arrays that begin with kind and schema version, checked on arrival.

Pure: bytes in, messages out. The only error it raises is CodecError.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar, assert_never

import msgpack

from common.errors import CodecError
from common.metrics.master import MasterMetrics
from common.metrics.slave import SlaveMetrics
from common.metrics.tree import from_tree, to_tree
from common.wire import fields
from common.wire.fields import ANGLE_LIMIT_RAD, MAX_DOUBT, MAX_ITEMS, MAX_NAME, MAX_TEXT, RATE_LIMIT_RAD_S
from common.wire.messages import (
    Action,
    ClockQuery,
    ClockReference,
    ClockReply,
    Command,
    CommandStamps,
    ControlReply,
    ControlRequest,
    Message,
    RobotState,
    StateHead,
    Statistics,
    Truth,
)
from common.wire.state_form import pack_state, unpack_head, unpack_state

VERSION = 6
READABLE = (4, 5, VERSION)
"""In version 4 a state told no clamped joints, and clock messages no reference; in version 5 commands and
states told no rate of commands. All else was as now."""
_ADDED: dict[int, dict[type, tuple[object, ...]]] = {
    5: {RobotState: (b"",), StateHead: (b"",), ClockQuery: (None,), ClockReply: (None,)},
    6: {RobotState: (0,), StateHead: (0,), Command: (0,)},
}
"""By version, what stands for its new fields in a message that is older."""
MAX_PAYLOAD = 256 * 1024
_POSTURE = (ANGLE_LIMIT_RAD, RATE_LIMIT_RAD_S)

_METRICS: dict[str, type[MasterMetrics | SlaveMetrics]] = {"master": MasterMetrics, "slave": SlaveMetrics}
"""What statistics hold, by the role of the process that sends them."""
_ROLES = {kind: role for role, kind in _METRICS.items()}

_pack = msgpack.Packer(autoreset=True).pack
_unpack = msgpack.unpackb
_Decoded = TypeVar("_Decoded")


def encode(message: Message) -> bytes:
    """The message's bytes. CodecError where it holds what no message of its kind can carry."""
    try:
        out: bytes = _pack(_packed(message))
    except Exception as error:
        raise CodecError(f"{type(message).__name__} cannot be encoded: {error}") from error
    return out


def decode(payload: bytes, kind: type[_Decoded], joints: int = 0) -> _Decoded:
    """The message of the expected kind with `joints` joints; CodecError says what is wrong with it."""
    name, unpack = _DECODERS[kind]
    if len(payload) > MAX_PAYLOAD:
        raise CodecError(f"{len(payload)} bytes, expected at most {MAX_PAYLOAD}")
    try:
        array = _unpack(payload, use_list=False, max_array_len=MAX_ITEMS, max_map_len=MAX_ITEMS)
    except Exception as error:  # msgpack raises ValueError, TypeError and its own family on garbage
        raise CodecError(f"not msgpack: {type(error).__name__}") from None
    if type(array) is not tuple or len(array) < 2:
        raise CodecError("not an array")
    if array[0] != name:
        raise CodecError(f"kind {fields.short(array[0])}, expected {name}")
    if type(array[1]) is not int or array[1] not in READABLE:
        raise CodecError(
            f"schema version {fields.short(array[1])}, expected {VERSION}: the other side runs another "
            "version of tandem, install the same on both hosts"
        )
    fields_of = array[2:]
    for version in range(array[1] + 1, VERSION + 1):
        fields_of += _ADDED[version].get(kind, ())
    message = unpack(fields_of, joints)
    assert isinstance(message, kind)
    return message


def state_joints(payload: bytes) -> int:
    """How many joints the robot of an encoded state has, for `decode`; 0 where the bytes are no state."""
    try:
        array = _unpack(payload, use_list=False, max_array_len=MAX_ITEMS, max_map_len=MAX_ITEMS)
        # the block of position_rad and setpoint_rad, float32 each (see state_form.py)
        return len(array[2 + 8]) // 8
    except Exception:  # as in decode, which then says what is wrong
        return 0


# one pair of functions a message, in the order of messages.py; the state's are in state_form.py


def _pack_command(m: Command) -> tuple[object, ...]:
    s = m.stamps
    return (
        m.robot, m.lease, m.sequence, m.tick, s.sampled_ns, s.frames_in_ns, s.angles_ns, s.put_ns,
        m.deadman_held, fields.pack_mask(m.valid), fields.pack_floats(m.position_rad, m.velocity_rad_s),
        m.seen_frame, m.seen_ns, fields.shorten(m.doubt, MAX_DOUBT), m.clutch_out, m.period_ms,
    )  # fmt: skip


def _unpack_command(f: tuple[object, ...], joints: int) -> Command:
    fields.array(f, 16)
    lease, sequence, tick, sampled_ns, frames_in_ns, angles_ns, put_ns = fields.counts(f[1:8])
    position_rad, velocity_rad_s = fields.floats(f[10], joints, _POSTURE)
    return Command(
        fields.text(f[0], MAX_NAME),
        lease,
        sequence,
        tick,
        CommandStamps(sampled_ns, frames_in_ns, angles_ns, put_ns),
        fields.flag(f[8]),
        fields.mask(f[9], joints),
        position_rad,
        velocity_rad_s,
        fields.count(f[11]),
        fields.count(f[12]),
        fields.text(f[13], MAX_DOUBT),
        fields.flag(f[14]),
        fields.count(f[15]),
    )


def _unpack_control_request(f: tuple[object, ...], _: int) -> ControlRequest:
    fields.array(f, 7)
    try:
        action = Action(fields.text(f[1], MAX_NAME))
    except ValueError:
        raise CodecError(f"action {fields.short(f[1])}, expected one of {', '.join(Action)}") from None
    operator, key = fields.text(f[2], MAX_NAME), fields.text(f[3], MAX_TEXT)
    robot = fields.text(f[0], MAX_NAME)
    clock, challenge = fields.counts(f[4:6])
    groups = fields.names(f[6], MAX_NAME)
    return ControlRequest(robot, action, operator, key, clock, challenge, groups)


def _pack_control_reply(m: ControlReply) -> tuple[object, ...]:
    text, place = fields.shorten(m.text, MAX_TEXT), fields.shorten(m.place, MAX_DOUBT)
    return (m.done, m.guard, text, m.lease, m.challenge, m.instance, place)


def _unpack_control_reply(f: tuple[object, ...], _: int) -> ControlReply:
    fields.array(f, 7)
    guard, text = fields.text(f[1], MAX_NAME), fields.text(f[2], MAX_TEXT)
    lease, challenge, instance = fields.counts(f[3:6])
    place = fields.text(f[6], MAX_TEXT)
    return ControlReply(fields.flag(f[0]), guard, text, lease, challenge, instance=instance, place=place)


def _pack_reference(r: ClockReference | None) -> tuple[object, ...] | None:
    if r is None:
        return None
    return (r.at_ns, r.ahead_ns, r.error_ns, r.rate_ppb, r.rate_error_ppb, r.source, r.scale)


def _unpack_reference(value: object) -> ClockReference | None:
    if value is None:
        return None
    at_ns, ahead_ns, error_ns, rate_ppb, rate_error_ppb, source, scale = fields.array(value, 7)
    return ClockReference(
        fields.count(at_ns),
        fields.signed(ahead_ns),
        fields.count(error_ns),
        fields.signed(rate_ppb),
        fields.count(rate_error_ppb),
        fields.text(source, MAX_NAME),
        fields.text(scale, MAX_NAME),
    )


def _unpack_clock_query(f: tuple[object, ...], _: int) -> ClockQuery:
    fields.array(f, 5)
    asked_ns, last_asked_ns, last_heard_ns, asker = fields.counts(f[:4])
    return ClockQuery(asked_ns, last_asked_ns, last_heard_ns, asker, _unpack_reference(f[4]))


def _unpack_clock_reply(f: tuple[object, ...], _: int) -> ClockReply:
    fields.array(f, 5)
    asked_ns, received_ns, replied_ns, instance = fields.counts(f[:4])
    return ClockReply(asked_ns, received_ns, replied_ns, instance, _unpack_reference(f[4]))


def _pack_statistics(m: Statistics) -> tuple[object, ...]:
    return (_ROLES[type(m.metrics)], m.sent_ns, to_tree(m.metrics))


def _unpack_statistics(f: tuple[object, ...], _: int) -> Statistics:
    fields.array(f, 3)
    role = fields.text(f[0], MAX_NAME)
    kind = _METRICS.get(role)
    if kind is None:
        raise CodecError(f"statistics of {fields.short(role)}, expected one of {', '.join(_METRICS)}")
    return Statistics(fields.count(f[1]), from_tree(kind, f[2]))


def _pack_truth(m: Truth) -> tuple[object, ...]:
    return (m.tick, m.sampled_ns, fields.pack_floats(m.position_rad, m.velocity_rad_s))


def _unpack_truth(f: tuple[object, ...], joints: int) -> Truth:
    fields.array(f, 3)
    position_rad, velocity_rad_s = fields.floats(f[2], joints, _POSTURE)
    return Truth(fields.count(f[0]), fields.count(f[1]), position_rad, velocity_rad_s)


def _packed(m: Message) -> tuple[object, ...]:
    """The array that is sent: kind, version, then the fields."""
    match m:
        case Command():
            return ("command", VERSION, *_pack_command(m))
        case RobotState():
            return ("state", VERSION, *pack_state(m))
        case ControlRequest():
            return (
                "control", VERSION, m.robot, m.action.value, m.operator, m.key, m.clock, m.challenge,
                m.groups,
            )  # fmt: skip
        case ControlReply():
            return ("controlled", VERSION, *_pack_control_reply(m))
        case ClockQuery():
            reference = _pack_reference(m.reference)
            return ("clock", VERSION, m.asked_ns, m.last_asked_ns, m.last_heard_ns, m.asker, reference)
        case ClockReply():
            reference = _pack_reference(m.reference)
            return ("clocked", VERSION, m.asked_ns, m.received_ns, m.replied_ns, m.instance, reference)
        case Statistics():
            return ("statistics", VERSION, *_pack_statistics(m))
        case Truth():
            return ("truth", VERSION, *_pack_truth(m))
    assert_never(m)


_DECODERS: dict[type, tuple[str, Callable[[tuple[object, ...], int], object]]] = {
    Command: ("command", _unpack_command),
    RobotState: ("state", unpack_state),
    StateHead: ("state", unpack_head),
    ControlRequest: ("control", _unpack_control_request),
    ControlReply: ("controlled", _unpack_control_reply),
    ClockQuery: ("clock", _unpack_clock_query),
    ClockReply: ("clocked", _unpack_clock_reply),
    Statistics: ("statistics", _unpack_statistics),
    Truth: ("truth", _unpack_truth),
}
