"""Ask the kernel, over rtnetlink, for the state of a CAN interface.

Message layout: linux/rtnetlink.h, linux/if_link.h, linux/can/netlink.h.
"""

from __future__ import annotations

import socket
import struct
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass

import can

from common.can.config import BusConfig
from common.can.controller import Controller

_STATES = tuple(Controller)
_GETLINK, _NEWLINK, _REQUEST = 18, 16, 1
_HEADER, _INFO = struct.Struct("=IHHII"), struct.Struct("=BxHiII")
_LINKINFO, _INFO_DATA = 18, 2
_BITTIMING, _STATE, _RESTART_MS = 1, 4, 6
_NEST_BITS = 0x3FFF
_TIMEOUT_S = 0.2


@dataclass(frozen=True, slots=True)
class KernelReport:
    """What the kernel reports of a CAN interface."""

    state: Controller | None
    bitrate: int = 0
    """0 where it is not known."""
    restart_ms: int = 0
    """So long after bus-off the kernel restarts the controller; 0: never by itself."""


def state_of(config: BusConfig, bus: can.BusABC) -> Controller | None:
    """The state of an open bus's controller; None if it is not known, as on a bus without one."""
    if config.interface == "socketcan":
        link = ask_kernel(config.channel)
        return None if link is None else link.state
    with suppress(Exception):  # drivers may raise what they like, NotImplementedError among it
        if bus.state is can.BusState.ERROR:
            return Controller.BUS_OFF
    return None


def ask_kernel(channel: str) -> KernelReport | None:
    """State and bit rate of a CAN interface; None if the kernel reports none of that name."""
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
            return read_report(wire.recv(1 << 16))
    except OSError:
        return None


def read_report(reply: bytes) -> KernelReport | None:
    """Read an RTM_NEWLINK message; None where it is another, or not of a CAN controller."""
    try:
        length, kind, *_ = _HEADER.unpack_from(reply)
        if kind != _NEWLINK:
            return None
        attributes = dict(_attributes(reply[_HEADER.size + _INFO.size : length]))
        info = dict(_attributes(attributes.get(_LINKINFO, b"")))
        data = dict(_attributes(info.get(_INFO_DATA, b"")))
        if _STATE not in data:
            return None
        number = _number(data[_STATE])
        return KernelReport(
            _STATES[number] if number < len(_STATES) else None,
            _number(data.get(_BITTIMING, b"")[:4]),
            _number(data.get(_RESTART_MS, b"")[:4]),
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
