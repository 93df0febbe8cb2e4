"""Open a udp_multicast bus without the echo of what this process sends: the kernel drops it.

To hear a frame and throw it away costs as much as to take it in: 36 answers a tick took 14 % of a core. So a
filter on the socket drops them before this process is woken. Other interfaces have no echo and get no filter.
Both functions raise BusError as `open_bus` does.
"""

from __future__ import annotations

import ctypes
import os
import socket
import struct
import sys

import can
from can.interfaces.udp_multicast.utils import pack_message

from common.can.config import BusConfig
from common.can.frame import CanFrame
from common.can.interface import descriptor, open_bus

_SO_ATTACH_FILTER = getattr(socket, "SO_ATTACH_FILTER", 26)
_UDP_HEADER_BYTES = 8
_CODE_BITS = 0x780
# classic BPF (linux/filter.h)
_LOAD_HALF, _LOAD_LENGTH, _AND, _JUMP_IF_EQUAL, _JUMP_IF_GREATER, _RETURN = 0x28, 0x80, 0x54, 0x15, 0x25, 0x06
_KEEP, _DROP = (_RETURN, 0, 0, 0xFFFF), (_RETURN, 0, 0, 0)

_Instruction = tuple[int, int, int, int]
"""Operation, how many instructions to skip if true, if false, and the operand."""


def open_without_function_code(config: BusConfig, function_code: int) -> can.BusABC:
    """A bus that hears no identifier from `function_code` to `function_code + 0x7F`.

    The function code is the upper four of an identifier's eleven bits, here at least 0x100.
    """
    # python-can packs with msgpack, in one order: where one identifier stands, all of two bytes do
    probe = pack_message(can.Message(arbitration_id=0x6A5, is_extended_id=False, data=b""))
    at = _UDP_HEADER_BYTES + probe.index(b"\xcd\x06\xa5") + 1
    return _open_filtered(
        config,
        (_LOAD_HALF, 0, 0, at),
        # an identifier below 0x100 is packed in fewer bytes; what stands here then has other upper bits
        (_AND, 0, 0, 0xF800 | _CODE_BITS),
        (_JUMP_IF_EQUAL, 0, 1, function_code),
        _DROP,
        _KEEP,
    )


def open_without_longer_than(config: BusConfig, longest: CanFrame) -> can.BusABC:
    """A bus that hears no frame whose datagram is longer than that of `longest`."""
    message = can.Message(arbitration_id=longest.id, data=longest.data, is_extended_id=False)
    length = _UDP_HEADER_BYTES + len(pack_message(message))
    return _open_filtered(config, (_LOAD_LENGTH, 0, 0, 0), (_JUMP_IF_GREATER, 1, 0, length), _KEEP, _DROP)


def _open_filtered(config: BusConfig, *instructions: _Instruction) -> can.BusABC:
    bus = open_bus(config)
    number = descriptor(bus)
    # a filter of the kernel's is Linux's; elsewhere the echo is heard and dropped by its identifier
    if config.interface == "udp_multicast" and number is not None and sys.platform.startswith("linux"):
        code = ctypes.create_string_buffer(b"".join(struct.pack("HBBI", *i) for i in instructions))
        program = struct.pack("HL", len(instructions), ctypes.addressof(code))
        with socket.socket(fileno=os.dup(number)) as wire:
            wire.setsockopt(socket.SOL_SOCKET, _SO_ATTACH_FILTER, program)
    return bus
