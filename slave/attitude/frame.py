"""The instrument's serial frame (paper D, section 3): FF, then three angles in tenths of a degree, BCD.

`FF 01 00 23 44 05 61` is inclination 10.0°, azimuth 234.4°, tool-face 56.1°. The azimuth is the magnetic one.
An angle that has no meaning travels as EE EE, which is no BCD: an addition to paper D's frame. The frame has
no check sum, but a header that no digit can be: whatever is lost or added, the next FF begins anew. `vote.py`
finds digits that were changed on the way. 360.0, as some instruments round 359.96, is 0.0.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

HEADER = 0xFF
LENGTH = 7
_NO_ANGLE = b"\xee\xee"
_HALF_TURN, _TURN = 1800, 3600
"""Tenths of a degree."""


@dataclass(frozen=True, slots=True)
class FrameAngles:
    """The angles of one frame, in its own unit: tenths of a degree."""

    inclination: int
    """0 to 1800."""
    azimuth: int | None
    """0 to 3599, magnetic; None where there is none."""
    tool_face: int | None
    """0 to 3599; None where there is none."""


def tenths(angle_rad: float) -> int:
    """The nearest tenth of a degree."""
    return round(math.degrees(angle_rad) * 10.0)


def radians(angle_tenths: int) -> float:
    """The inverse of `tenths`."""
    return math.radians(angle_tenths / 10.0)


def of_angles(inclination_rad: float, azimuth_rad: float | None, tool_face_rad: float | None) -> FrameAngles:
    """Angles rounded to the frame's resolution; 359.96° is 0.0°."""
    return FrameAngles(
        tenths(inclination_rad),
        None if azimuth_rad is None else tenths(azimuth_rad) % _TURN,
        None if tool_face_rad is None else tenths(tool_face_rad) % _TURN,
    )


def encode(angles: FrameAngles) -> bytes:
    """The seven bytes. Raises ValueError where an angle is out of range."""
    if not 0 <= angles.inclination <= _HALF_TURN:
        raise ValueError(f"an inclination of {angles.inclination} tenths of a degree")
    parts = [_bcd(angles.inclination)]
    for angle in (angles.azimuth, angles.tool_face):
        if angle is not None and not 0 <= angle < _TURN:
            raise ValueError(f"an angle of {angle} tenths of a degree")
        parts.append(_NO_ANGLE if angle is None else _bcd(angle))
    return bytes([HEADER]) + b"".join(parts)


def decode(frame: bytes) -> FrameAngles | None:
    """The angles of seven bytes, or None where they are no frame."""
    if len(frame) != LENGTH or frame[0] != HEADER:
        return None
    inclination = _number(frame[1:3], _HALF_TURN)
    azimuth, tool_face = (
        None if part == _NO_ANGLE else _number(part, _TURN) for part in (frame[3:5], frame[5:7])
    )
    if inclination is None or (azimuth is None and frame[3:5] != _NO_ANGLE):
        return None
    if tool_face is None and frame[5:7] != _NO_ANGLE:
        return None
    return FrameAngles(
        inclination,
        None if azimuth is None else azimuth % _TURN,
        None if tool_face is None else tool_face % _TURN,
    )


@dataclass(slots=True)
class FrameParser:
    """Bytes in as they come, frames out; never raises, and counts what it could not use."""

    frames: int = 0
    refused: int = 0
    """Frames that were cut short, or whose digits are no angles."""
    garbage: int = 0
    """Bytes outside of any frame."""
    _open: bytearray = field(default_factory=bytearray)

    def feed(self, data: bytes) -> list[FrameAngles]:
        """Every frame that is complete now, in order."""
        found = []
        for byte in data:
            if byte == HEADER:
                self.refused += bool(self._open)
                self._open[:] = b"\xff"
            elif not self._open:
                self.garbage += 1
            else:
                self._open.append(byte)
                if len(self._open) == LENGTH:
                    angles = decode(bytes(self._open))
                    self._open.clear()
                    if angles is None:
                        self.refused += 1
                    else:
                        self.frames += 1
                        found.append(angles)
        return found


def _bcd(value: int) -> bytes:
    return bytes.fromhex(f"{value:04d}")


def _number(pair: bytes, most: int) -> int | None:
    digits = pair.hex()
    return int(digits) if digits.isdecimal() and int(digits) <= most else None
