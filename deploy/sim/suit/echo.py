"""Spare the simulated suit its own echo: on udp_multicast each sender hears what it sent.

36 answers a tick cost 14 % of a core to hear and throw away. A SYNC's datagram is shorter than any answer's,
so the kernel can drop the rest by length before this process is woken.
"""

from __future__ import annotations

import ctypes
import os
import socket
import struct

import can
from can.interfaces.udp_multicast.utils import pack_message

from common.can.config import BusConfig
from common.can.frame import Frame
from common.can.interface import descriptor, open_bus

_SO_ATTACH_FILTER = getattr(socket, "SO_ATTACH_FILTER", 26)
_UDP_HEADER_BYTES = 8
# classic BPF (linux/filter.h): load the packet's length, drop it if it is greater, else keep all of it
_LOAD_LENGTH, _JUMP_IF_GREATER, _RETURN = 0x80, 0x25, 0x06
_WHOLE = 0xFFFF


def open_deaf_to_answers(config: BusConfig, sync: Frame) -> can.BusABC:
    """Open a bus that hears no frame longer than `sync`. Other interfaces have no echo and are left alone."""
    bus = open_bus(config)
    number = descriptor(bus)
    if config.interface == "udp_multicast" and number is not None:
        message = can.Message(arbitration_id=sync.id, data=sync.data, is_extended_id=False)
        with socket.socket(fileno=os.dup(number)) as wire:
            _drop_longer_than(wire, len(pack_message(message)))
    return bus


def _drop_longer_than(wire: socket.socket, payload_bytes: int) -> None:
    instructions = (
        (_LOAD_LENGTH, 0, 0, 0),
        (_JUMP_IF_GREATER, 1, 0, payload_bytes + _UDP_HEADER_BYTES),
        (_RETURN, 0, 0, _WHOLE),
        (_RETURN, 0, 0, 0),
    )
    code = ctypes.create_string_buffer(b"".join(struct.pack("HBBI", *i) for i in instructions))
    program = struct.pack("HL", len(instructions), ctypes.addressof(code))
    wire.setsockopt(socket.SOL_SOCKET, _SO_ATTACH_FILTER, program)
