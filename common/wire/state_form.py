"""The robot's state as the fields of a message: packed, and checked on arrival. Pure.

The only error it raises is CodecError.
"""

from __future__ import annotations

import math

from common.wire import fields
from common.wire.fields import ANGLE_LIMIT_RAD, MAX_DOUBT, MAX_NAME, MAX_TEXT
from common.wire.messages import BaseAttitude, CommandEcho, RobotState, StateHead

CONTROL_BYTES = 1100
"""Of a command, a state, and whatever else the robot is controlled by. With the headers of IPv6, TCP, TLS and
Zenoh a packet stays below 1280 bytes, which every path carries; many VPNs swallow larger ones silently."""
_STATE_NUMBERS_BYTES = 200
"""Of a state's numbers, kind and lengths."""
MAX_WAY_M, MAX_WAY_S = 100.0, 100.0
"""Of a hand after the line has died."""
_NUMBER_BYTES = 9
_ANGLES = (ANGLE_LIMIT_RAD, ANGLE_LIMIT_RAD)


def pack_state(m: RobotState) -> tuple[object, ...]:
    """Its fields; the faults' words are cut where the whole would be too long for a packet."""
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


def unpack_state(f: tuple[object, ...], joints: int) -> RobotState:
    """The state, every field checked. Raises CodecError."""
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


def unpack_head(f: tuple[object, ...], joints: int) -> StateHead:
    """Its head. Of the joints' blocks only the lengths are looked at: the robot's own kind of body.

    Raises CodecError.
    """
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
