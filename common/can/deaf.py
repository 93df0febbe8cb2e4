"""Spare a sender its own echo: on udp_multicast each sender hears what it sent.

To hear a frame and throw it away costs as much as to take it in. The kernel can drop it before this process
is woken, by the function code: the upper four of an identifier's eleven bits.
"""

from __future__ import annotations

import ctypes
import os
import socket
import struct

import can
from can.interfaces.udp_multicast.utils import pack_message

from common.can.config import BusConfig
from common.can.interface import descriptor, open_bus

_SO_ATTACH_FILTER = getattr(socket, "SO_ATTACH_FILTER", 26)
_UDP_HEADER_BYTES = 8
_CODE_BITS = 0x780
# classic BPF (linux/filter.h): load a halfword, mask it, go on if equal, end with so much kept
_LOAD_HALF, _AND, _JUMP_IF_EQUAL, _RETURN = 0x28, 0x54, 0x15, 0x06
_WHOLE = 0xFFFF


def open_deaf_to(config: BusConfig, function_code: int) -> can.BusABC:
    """Open a bus that hears no identifier from `function_code` to `function_code + 0x7F`.

    `function_code` is at least 0x100. Other interfaces have no echo and are left alone.
    Raises BusError as `open_bus` does.
    """
    bus = open_bus(config)
    number = descriptor(bus)
    if config.interface == "udp_multicast" and number is not None:
        with socket.socket(fileno=os.dup(number)) as wire:
            _drop_code(wire, function_code)
    return bus


def _drop_code(wire: socket.socket, function_code: int) -> None:
    # python-can packs with msgpack, in one order: where one identifier stands, all of two bytes do
    probe = pack_message(can.Message(arbitration_id=0x6A5, is_extended_id=False, data=b""))
    at = _UDP_HEADER_BYTES + probe.index(b"\xcd\x06\xa5") + 1
    instructions = (
        (_LOAD_HALF, 0, 0, at),
        # an identifier below 0x100 is packed in fewer bytes; what stands here then has other upper bits
        (_AND, 0, 0, 0xF800 | _CODE_BITS),
        (_JUMP_IF_EQUAL, 0, 1, function_code),
        (_RETURN, 0, 0, 0),
        (_RETURN, 0, 0, _WHOLE),
    )
    code = ctypes.create_string_buffer(b"".join(struct.pack("HBBI", *i) for i in instructions))
    program = struct.pack("HL", len(instructions), ctypes.addressof(code))
    wire.setsockopt(socket.SOL_SOCKET, _SO_ATTACH_FILTER, program)
