"""A drive's emergency messages as text (CiA 301 emergency object, CiA 402-1 error codes). Pure."""

from __future__ import annotations

import struct
from dataclasses import dataclass

NO_ERROR, HEARTBEAT_MISSED, PDO_MISSED = 0x0000, 0x8130, 0x8250
SAFE_TORQUE_OFF = 0x8A88
"""maxon EPOS4 ("STO error"). CiA 402 names no code for it, so each maker has another."""

CODES = {
    0x1000: "generic error",
    0x2220: "over-current inside of the drive",
    0x2310: "over-current at the output",
    0x2320: "short circuit at the output",
    0x2330: "earth leakage at the output",
    0x2340: "short circuit of the motor",
    0x3110: "over-voltage of the mains",
    0x3120: "under-voltage of the mains",
    0x3130: "a phase is missing",
    0x3210: "over-voltage of the supply",
    0x3220: "under-voltage of the supply",
    0x4110: "ambient temperature too high",
    0x4210: "over-temperature of the drive",
    0x4310: "over-temperature of the motor",
    0x5113: "under-voltage of its 5 V supply",
    0x5200: "control hardware failed",
    0x5440: "its contacts failed",
    0x5530: "its memory failed",
    0x6100: "its software failed",
    0x6320: "a parameter is wrong",
    0x7110: "its brake failed",
    0x7121: "the motor is blocked",
    0x7122: "wrong commutation, or the motor's wires are swapped",
    0x7300: "a sensor failed",
    0x7303: "resolver 1 failed",
    0x7305: "the motor's encoder failed",
    0x7306: "its second encoder failed",
    0x7310: "too fast",
    0x7320: "its position sensor failed",
    0x8110: "CAN frames lost",
    0x8120: "CAN error passive",
    HEARTBEAT_MISSED: "it missed the slave's heartbeat",
    0x8140: "recovered from bus-off",
    0x8150: "two nodes send one identifier",
    0x8210: "a PDO was too short",
    0x8220: "a PDO was too long",
    0x8240: "it waits for a SYNC of another length",
    PDO_MISSED: "it missed its PDO",
    0x8480: "its speed controller failed",
    0x8500: "its position controller failed",
    0x8611: "following error",
    0x8612: "position limit reached",
    SAFE_TORQUE_OFF: "safe torque off is active",
    0xFF01: "fault asked for",
}
"""The texts by error code."""

CLASSES = {
    0x1: "generic error",
    0x2: "current",
    0x3: "voltage",
    0x4: "temperature",
    0x5: "hardware",
    0x6: "software",
    0x7: "an additional module",
    0x8: "monitoring",
    0x9: "an external error",
    0xF: "of the manufacturer's own",
}
"""The texts by the code's first digit, for codes that are not in CODES."""

REGISTER = (
    "generic",
    "current",
    "voltage",
    "temperature",
    "communication",
    "profile",
    "reserved",
    "manufacturer",
)
"""Bits of the error register (1001h)."""

_HEAD = struct.Struct("<HB")


@dataclass(frozen=True, slots=True)
class Emergency:
    """One message."""

    code: int
    register: int
    own: bytes = b""
    """The maker's five bytes; told where the code alone says little."""

    @property
    def over(self) -> bool:
        """Whether it says that all errors are gone."""
        return self.code == NO_ERROR

    @property
    def words(self) -> str:
        """The message for a person."""
        named = CODES.get(self.code) or f"{CLASSES.get(self.code >> 12, 'unknown')}"
        bits = [name for bit, name in enumerate(REGISTER) if self.register >> bit & 1 and name != "generic"]
        makers = [f"maker's bytes {self.own.hex(' ')}"] if any(self.own) and self.code not in CODES else []
        return f"{named} (code {', '.join([f'{self.code:04X}', *bits, *makers])})"


def emergency(data: bytes) -> Emergency | None:
    """Read a message; None where it is not 8 bytes long."""
    if len(data) != 8:
        return None
    code, register = _HEAD.unpack_from(data)
    return Emergency(code, register, data[3:])
