"""Protocol 2.0 at the wire, from its description: framing, byte stuffing and CRC-16. Pure.

ROBOTIS e-Manual, "DYNAMIXEL Protocol 2.0". Written apart from the library that the adapter uses, so
that each checks the other.
"""

from __future__ import annotations

from dataclasses import dataclass

PING, READ, WRITE, REBOOT, STATUS, SYNC_READ, SYNC_WRITE = 0x01, 0x02, 0x03, 0x08, 0x55, 0x82, 0x83
BROADCAST = 0xFE
_HEADER = b"\xff\xff\xfd\x00"
_PATTERN, _STUFFED = b"\xff\xff\xfd", b"\xff\xff\xfd\xfd"
_LENGTH_AT, _BODY_AT = 5, 7
_LEAST, _MOST = 3, 1024
"""Of the length field: instruction and checksum; longer than any that is sent here."""


def _crc_of(byte: int) -> int:
    crc = byte << 8
    for _ in range(8):
        crc = (crc << 1) ^ (0x8005 if crc & 0x8000 else 0)
    return crc & 0xFFFF


_TABLE = tuple(_crc_of(byte) for byte in range(256))


def crc16(data: bytes) -> int:
    """CRC-16 with polynomial 0x8005, from 0, most significant bit first (CRC-16/UMTS)."""
    crc = 0
    for byte in data:
        crc = (crc << 8 & 0xFFFF) ^ _TABLE[crc >> 8 ^ byte]
    return crc


def frame(servo: int, instruction: int, parameters: bytes = b"") -> bytes:
    """One packet as it travels."""
    body = stuff(bytes([instruction]) + parameters)
    packet = _HEADER + bytes([servo]) + (len(body) + 2).to_bytes(2, "little") + body
    return packet + crc16(packet).to_bytes(2, "little")


def stuff(body: bytes) -> bytes:
    """A header never appears inside a packet: every FF FF FD gets one FD more."""
    return body.replace(_PATTERN, _STUFFED)


def unstuff(body: bytes) -> bytes:
    """The body before it was stuffed."""
    return body.replace(_STUFFED, _PATTERN)


@dataclass(frozen=True, slots=True)
class Packet:
    """One packet that was whole."""

    servo: int
    instruction: int
    parameters: bytes


class Parser:
    """Finds packets in a stream that may begin anywhere, be cut anywhere, and hold anything besides."""

    def __init__(self) -> None:
        self._bytes = bytearray()
        self.dropped = 0
        """Bytes that belonged to no whole packet."""

    def feed(self, data: bytes) -> list[Packet]:
        """The packets that these bytes complete."""
        self._bytes += data
        out: list[Packet] = []
        while self._to_header():
            if len(self._bytes) < _BODY_AT:
                break
            length = int.from_bytes(self._bytes[_LENGTH_AT:_BODY_AT], "little")
            if not _LEAST <= length <= _MOST:
                self._skip(1)
                continue
            end = _BODY_AT + length
            if len(self._bytes) < end:
                break
            packet = bytes(self._bytes[:end])
            if crc16(packet[:-2]) != int.from_bytes(packet[-2:], "little"):
                # not a packet, or a broken one: the next may begin inside it
                self._skip(1)
                continue
            del self._bytes[:end]
            body = unstuff(packet[_BODY_AT:-2])
            out.append(Packet(packet[4], body[0], body[1:]))
        return out

    def quiet(self) -> None:
        """Nothing came for a while: what is half there will never be whole."""
        self._skip(len(self._bytes))

    def _to_header(self) -> bool:
        at = self._bytes.find(_HEADER)
        if at < 0:
            # the end may be the beginning of one
            keep = next((n for n in (3, 2, 1) if self._bytes.endswith(_HEADER[:n])), 0)
            at = len(self._bytes) - keep
            self._skip(at)
            return False
        self._skip(at)
        return True

    def _skip(self, count: int) -> None:
        self.dropped += count
        del self._bytes[:count]
