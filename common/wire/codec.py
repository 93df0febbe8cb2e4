"""Messages as msgpack arrays that begin with kind and schema version, checked on arrival.

Pure: bytes in, messages out. The only error it raises is CodecError.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TypeVar, assert_never

import msgpack

from common.errors import CodecError
from common.metrics.master import MasterMetrics
from common.metrics.slave import SlaveMetrics
from common.metrics.tree import from_tree, to_tree
from common.wire import fields
from common.wire.fields import MAX_DOUBT, MAX_ITEMS, MAX_NAME, MAX_TEXT
from common.wire.messages import (
    Action,
    BaseAttitude,
    ClockQuery,
    ClockReference,
    ClockReply,
    Command,
    CommandEcho,
    CommandStamps,
    ControlReply,
    ControlRequest,
    Message,
    RobotState,
    StateHead,
    Statistics,
    Truth,
)

VERSION = 6
READABLE = (4, 5, VERSION)
"""In version 4 a state told no clamped joints, and clock messages no reference; in version 5 commands and
states told no rate of commands. All else was as now."""
_ADDED: dict[int, dict[type, tuple[object, ...]]] = {
    5: {RobotState: (b"",), StateHead: (b"",), ClockQuery: (None,), ClockReply: (None,)},
    6: {RobotState: (0,), StateHead: (0,), Command: (0,)},
}
"""By version, what stands for its new fields in a message that is older."""
CONTROL_BYTES = 1100
"""Of a command, a state, and whatever else the robot is controlled by. With the headers of IPv6, TCP, TLS and
Zenoh a packet stays below 1280 bytes, which every path carries; many VPNs swallow larger ones silently."""
_STATE_NUMBERS_BYTES = 200
"""Of a state's numbers, kind and lengths."""
MAX_WAY_M, MAX_WAY_S = 100.0, 100.0
"""Of a hand after the line has died."""
_NUMBER_BYTES = 9
MAX_PAYLOAD = 256 * 1024
ANGLE_LIMIT_RAD = 4 * math.pi
"""No joint turns twice round; a larger angle is a fault, not a posture."""
RATE_LIMIT_RAD_S = 100.0
_POSTURE = (ANGLE_LIMIT_RAD, RATE_LIMIT_RAD_S)
_ANGLES = (ANGLE_LIMIT_RAD, ANGLE_LIMIT_RAD)

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
        # the block of position_rad and setpoint_rad, float32 each (see _unpack_state)
        return len(array[2 + 8]) // 8
    except Exception:  # as in decode, which then says what is wrong
        return 0


# one pair of functions a message, in the order of messages.py


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


def _pack_state(m: RobotState) -> tuple[object, ...]:
    e = m.echo
    echo = None if e is None else (e.sequence, e.put_ns, e.received_ns, e.accepted_ns, e.written_ns)
    reason = fields.shorten(m.reason, MAX_DOUBT)
    mask, angles = fields.pack_mask(m.encoder_valid), fields.pack_floats(m.position_rad, m.setpoint_rad)
    torques = fields.pack_torques(m.effort_nm), fields.pack_torques(m.external_nm)
    named = (m.robot, m.guard, reason, m.operator, *m.resting)
    clamped = b"" if m.clamped is None else fields.pack_bits(m.clamped)
    texts = (name.encode("utf-8") for name in named)
    blocks = (mask, angles, clamped, *(block or b"" for block in torques), *texts)
    taken = _STATE_NUMBERS_BYTES + sum(map(len, blocks)) + _NUMBER_BYTES * (2 + len(m.blind_m))
    return (
        m.robot, m.sequence, m.sent_ns, m.encoder_ns, m.guard, reason, m.operator, mask, angles, echo,
        m.master_offset_ns, m.offset_bound_ns, fields.fit_texts(m.faults, CONTROL_BYTES - taken),
        _pack_base(m.base), m.lease_id, m.instance, m.resting, *torques, m.blind_m, m.blind_s,
        clamped, m.wanted_period_ms,
    )  # fmt: skip


def _unpack_state(f: tuple[object, ...], joints: int) -> RobotState:
    fields.array(f, 23)
    sequence, sent_ns, encoder_ns = fields.counts(f[1:4])
    position_rad, setpoint_rad = fields.floats(f[8], joints, _ANGLES)
    return RobotState(
        robot=fields.text(f[0], MAX_NAME),
        sequence=sequence,
        sent_ns=sent_ns,
        encoder_ns=encoder_ns,
        guard=fields.text(f[4], MAX_NAME),
        reason=fields.text(f[5], MAX_TEXT),
        operator=fields.text(f[6], MAX_NAME),
        encoder_valid=fields.mask(f[7], joints),
        position_rad=position_rad,
        setpoint_rad=setpoint_rad,
        echo=_unpack_echo(f[9]),
        master_offset_ns=fields.signed(f[10]),
        offset_bound_ns=fields.signed(f[11]),
        faults=fields.texts(f[12], MAX_NAME, MAX_TEXT),
        base=_unpack_base(f[13]),
        lease_id=fields.count(f[14]),
        instance=fields.count(f[15]),
        resting=fields.names(f[16], MAX_NAME),
        effort_nm=fields.torques(f[17], joints),
        external_nm=fields.torques(f[18], joints),
        blind_m=fields.numbers(f[19], 0.0, MAX_WAY_M),
        blind_s=fields.number(f[20], 0.0, MAX_WAY_S),
        clamped=fields.bits(f[21], joints),
        wanted_period_ms=fields.count(f[22]),
    )


def _unpack_head(f: tuple[object, ...], joints: int) -> StateHead:
    """Of the joints' blocks only the lengths are looked at: the robot's own kind of body."""
    fields.array(f, 23)
    fields.length(f[7], joints)
    fields.length(f[8], 8 * joints)
    return StateHead(
        sequence=fields.count(f[1]),
        sent_ns=fields.count(f[2]),
        guard=fields.text(f[4], MAX_NAME),
        reason=fields.text(f[5], MAX_TEXT),
        operator=fields.text(f[6], MAX_NAME),
        echo=_unpack_echo(f[9]),
        faults=fields.texts(f[12], MAX_NAME, MAX_TEXT),
        resting=fields.names(f[16], MAX_NAME),
        lease_id=fields.count(f[14]),
        instance=fields.count(f[15]),
        wanted_period_ms=fields.count(f[22]),
    )


def _pack_base(base: BaseAttitude | None) -> tuple[object, ...] | None:
    if base is None:
        return None
    return (base.measured_ns, base.inclination_rad, base.azimuth_rad, base.tool_face_rad, base.tilt_rad)


def _unpack_base(value: object) -> BaseAttitude | None:
    if value is None:
        return None
    measured_ns, inclination, azimuth, tool_face, tilt = fields.array(value, 5)
    return BaseAttitude(
        fields.count(measured_ns),
        fields.number(inclination, 0.0, math.pi),
        None if azimuth is None else fields.number(azimuth, 0.0, math.tau),
        None if tool_face is None else fields.number(tool_face, 0.0, math.tau),
        fields.number(tilt, 0.0, math.pi),
    )


def _unpack_echo(value: object) -> CommandEcho | None:
    if value is None:
        return None
    return CommandEcho(*fields.counts(fields.array(value, 5)))


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
            return ("state", VERSION, *_pack_state(m))
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
    RobotState: ("state", _unpack_state),
    StateHead: ("state", _unpack_head),
    ControlRequest: ("control", _unpack_control_request),
    ControlReply: ("controlled", _unpack_control_reply),
    ClockQuery: ("clock", _unpack_clock_query),
    ClockReply: ("clocked", _unpack_clock_reply),
    Statistics: ("statistics", _unpack_statistics),
    Truth: ("truth", _unpack_truth),
}
