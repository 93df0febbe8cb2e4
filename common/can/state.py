"""How a CAN controller stands: by its error frames, by the kernel, by python-can. In words.

ISO 11898-1: a controller counts errors. From 96 on it is in error-warning, above 127 error-passive (it may no
longer destroy others' frames), above 255 it is bus-off: it has left the bus, neither sends nor hears, and
comes back only when it is restarted.
"""

from __future__ import annotations

import socket
import struct
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from enum import StrEnum

import can

from common.can.config import BusConfig


class Controller(StrEnum):
    """The states, in the words of the standard; in the order of the kernel's enum can_state."""

    ERROR_ACTIVE = "error-active"
    ERROR_WARNING = "error-warning"
    ERROR_PASSIVE = "error-passive"
    BUS_OFF = "bus-off"
    STOPPED = "stopped"
    SLEEPING = "sleeping"


CANNOT_SPEAK = frozenset({Controller.BUS_OFF, Controller.STOPPED, Controller.SLEEPING})
_STATES = tuple(Controller)

# linux/can/error.h: classes in the identifier, details in the data
_CONTROLLER, _PROTOCOL, _TRANSCEIVER, _NO_ACK = 0x04, 0x08, 0x10, 0x20
_BUS_OFF, _BUS_ERROR, RESTARTED, _COUNTERS = 0x40, 0x80, 0x100, 0x200
_BY_DETAIL = (
    (0x30, Controller.ERROR_PASSIVE),
    (0x0C, Controller.ERROR_WARNING),
    (0x40, Controller.ERROR_ACTIVE),
)
_OVERFLOW = {0x01: "the controller lost frames that came in", 0x02: "the controller lost frames to send"}


def of_error_frame(error_id: int, data: bytes) -> Controller | None:
    """What a SocketCAN error frame says of the controller's state; None where it says nothing of it."""
    if error_id & _BUS_OFF:
        return Controller.BUS_OFF
    if error_id & _CONTROLLER and len(data) > 1:
        for mask, state in _BY_DETAIL:
            if data[1] & mask:
                return state
    return Controller.ERROR_ACTIVE if error_id & RESTARTED else None


def error_words(error_id: int, data: bytes) -> str:
    """A SocketCAN error frame in words."""
    said = []
    state = of_error_frame(error_id, data)
    if error_id & RESTARTED:
        said.append("the controller was restarted")
    elif state is not None:
        said.append(f"the controller is {state}")
    if error_id & _CONTROLLER and len(data) > 1:
        said += [words for bit, words in _OVERFLOW.items() if data[1] & bit]
    if error_id & _NO_ACK:
        said.append("nobody acknowledges: no other node on the bus, or the wire is cut")
    if error_id & (_PROTOCOL | _BUS_ERROR):
        said.append("frames are destroyed: look at the bit rate, the wiring, 120 Ω at both ends")
    if error_id & _TRANSCEIVER:
        said.append("the transceiver reports a fault of the wires")
    if error_id & _COUNTERS and len(data) > 7:
        said.append(f"{data[6]} errors of sending and {data[7]} of receiving counted")
    return "; ".join(said) or f"error frame {error_id:#x}"


@dataclass(frozen=True, slots=True)
class Link:
    """What the kernel tells of a CAN interface."""

    state: Controller | None
    bitrate: int = 0
    """0 where it is not known."""
    restart_ms: int = 0
    """So long after bus-off the kernel restarts the controller; 0: never by itself."""


def state_of(config: BusConfig, bus: can.BusABC) -> Controller | None:
    """How the controller of an open bus stands; None where nothing tells, as on a bus without one."""
    if config.interface == "socketcan":
        link = ask_kernel(config.channel)
        return None if link is None else link.state
    with suppress(Exception):  # drivers may raise what they like, NotImplementedError among it
        if bus.state is can.BusState.ERROR:
            return Controller.BUS_OFF
    return None


def bus_off_words(channel: str, link: Link | None) -> str:
    """What bus-off means and what to do."""
    told = (
        "bus-off: the controller has left the bus after too many errors; look at the wiring, 120 Ω at both "
    )
    told += "ends, and that all speak at one bit rate; "
    if link is not None and link.restart_ms:
        return f"{told}the kernel restarts it after {link.restart_ms} ms (restart-ms)"
    return (
        f"{told}`ip link set {channel} type can restart` restarts it, "
        f"`ip link set {channel} type can restart-ms 100` lets it recover by itself"
    )


# rtnetlink (linux/rtnetlink.h, linux/if_link.h, linux/can/netlink.h)
_GETLINK, _NEWLINK, _REQUEST = 18, 16, 1
_HEADER, _INFO = struct.Struct("=IHHII"), struct.Struct("=BxHiII")
_LINKINFO, _INFO_DATA = 18, 2
_BITTIMING, _STATE, _RESTART_MS = 1, 4, 6
_NEST_BITS = 0x3FFF
_TIMEOUT_S = 0.2


def ask_kernel(channel: str) -> Link | None:
    """State and bit rate of a CAN interface; None where the kernel tells nothing of that name."""
    family = getattr(socket, "AF_NETLINK", None)
    try:
        index = socket.if_nametoindex(channel)
        if family is None:
            return None
        with socket.socket(family, socket.SOCK_RAW, 0) as wire:
            wire.settimeout(_TIMEOUT_S)
            wire.send(
                _HEADER.pack(_HEADER.size + _INFO.size, _GETLINK, _REQUEST, 1, 0)
                + _INFO.pack(0, 0, index, 0, 0)
            )
            return read_link(wire.recv(1 << 16))
    except OSError:
        return None


def read_link(reply: bytes) -> Link | None:
    """Read an RTM_NEWLINK message; None where it is another, or not of a CAN controller."""
    try:
        length, kind, *_ = _HEADER.unpack_from(reply)
        if kind != _NEWLINK:
            return None
        attributes = dict(_attributes(reply[_HEADER.size + _INFO.size : length]))
        info = dict(_attributes(attributes.get(_LINKINFO, b"")))
        told = dict(_attributes(info.get(_INFO_DATA, b"")))
        if _STATE not in told:
            return None
        number = _number(told[_STATE])
        return Link(
            _STATES[number] if number < len(_STATES) else None,
            _number(told.get(_BITTIMING, b"")[:4]),
            _number(told.get(_RESTART_MS, b"")[:4]),
        )
    except struct.error:
        return None


def _attributes(data: bytes) -> Iterator[tuple[int, bytes]]:
    at = 0
    while at + 4 <= len(data):
        length, kind = struct.unpack_from("=HH", data, at)
        if length < 4:
            return
        yield kind & _NEST_BITS, data[at + 4 : at + length]
        at += (length + 3) & ~3


def _number(data: bytes) -> int:
    return int.from_bytes(data, "little" if struct.pack("=H", 1)[0] else "big")
