"""chronyd's command protocol, version 6: the request `tracking` and its answer. Pure.

The layout is that of chrony's candm.h. A request is as long as its answer, so that nobody can use the daemon
to multiply traffic. chronyd answers it to anybody on its own host (127.0.0.1, port 323).
"""

from __future__ import annotations

import struct
from dataclasses import dataclass

from common.clock import NS_PER_S

_VERSION, _REQUEST, _REPLY = 6, 1, 2
_TRACKING, _IS_TRACKING = 33, 5
_HEAD = struct.Struct("!BBBBHHHHHHIII")
_ASK = struct.Struct("!BBBBHHIII")
_BODY = struct.Struct("!I16sHHHHIII9I")
ANSWER_BYTES = _HEAD.size + _BODY.size
_EXPONENT_BITS, _COEFFICIENT_BITS = 7, 25
_LOCAL = 0x7F7F0101
"""The reference of a daemon that follows nobody: its own clock (`local`)."""
_UNSYNCHRONISED = 3
_DEEPEST = 16
_MOST_S, _MOST_PPM = 16.0, 100_000.0
"""Beyond these no statement is believed: NTP's largest dispersion (RFC 5905), a tenth of the clock's rate."""


@dataclass(frozen=True, slots=True)
class Tracking:
    """What chronyd states of the system clock. Seconds."""

    reference: int
    """Who is followed: an IPv4 address, or the first four characters of a reference clock's name."""
    stratum: int
    leap: int
    """0 none, 1 insert, 2 delete, 3 not synchronised."""
    correction_s: float
    """Reference minus system clock: what is still to be corrected."""
    last_offset_s: float
    skew_ppm: float
    root_delay_s: float
    root_dispersion_s: float

    @property
    def error_ns(self) -> int:
        """The most that it may be wrong by its own statement: root distance, and the newest offset."""
        return round((self.root_dispersion_s + self.root_delay_s / 2 + abs(self.last_offset_s)) * NS_PER_S)

    @property
    def nothing_stated(self) -> str:
        """Why this says nothing of another host's clock; empty where it does."""
        if self.leap == _UNSYNCHRONISED or not self.reference or not 0 < self.stratum < _DEEPEST:
            return "chronyd is not synchronised"
        if self.reference == _LOCAL:
            return "chronyd follows no source but its own clock"
        if implausible := self._implausible():
            return f"chronyd states {implausible}: not believed"
        return ""

    def _implausible(self) -> str:
        """The first figure that no clock of use has, in words; empty where there is none."""
        bounds = (
            ("a root delay", self.root_delay_s, 0.0, _MOST_S, "s"),
            ("a root dispersion", self.root_dispersion_s, 0.0, _MOST_S, "s"),
            ("a newest offset", self.last_offset_s, -_MOST_S, _MOST_S, "s"),
            ("a correction", self.correction_s, -_MOST_S, _MOST_S, "s"),
            ("a skew", self.skew_ppm, 0.0, _MOST_PPM, "ppm"),
        )
        for name, value, least, most, unit in bounds:
            if not least <= value <= most:
                return f"{name} of {value:g} {unit}, expected {least:g} to {most:g}"
        return "" if self.error_ns > 0 else "an error of nothing"


def tracking_request(number: int) -> bytes:
    """The question; the answer bears its number."""
    return _ASK.pack(_VERSION, _REQUEST, 0, 0, _TRACKING, 0, number, 0, 0).ljust(ANSWER_BYTES, b"\0")


def read_tracking(answer: bytes, number: int) -> Tracking | None:
    """The answer to the question of that number; None for anything else."""
    if len(answer) < ANSWER_BYTES:
        return None
    version, kind, _, _, command, reply, status, _, _, _, sequence, _, _ = _HEAD.unpack_from(answer)
    if (version, kind, command, reply, status, sequence) != (
        _VERSION, _REPLY, _TRACKING, _IS_TRACKING, 0, number,
    ):  # fmt: skip
        return None
    reference, _, _, _, stratum, leap, _, _, _, *floats = _BODY.unpack_from(answer, _HEAD.size)
    correction, last, _, _, _, skew, delay, dispersion, _ = map(_seconds, floats)
    return Tracking(reference, stratum, leap, correction, last, skew, delay, dispersion)


def _seconds(packed: int) -> float:
    """Chrony's own float: a signed exponent of 7 bits, a signed coefficient of 25."""
    exponent = packed >> _COEFFICIENT_BITS
    coefficient = packed & ((1 << _COEFFICIENT_BITS) - 1)
    exponent -= (exponent >> (_EXPONENT_BITS - 1)) << _EXPONENT_BITS
    coefficient -= (coefficient >> (_COEFFICIENT_BITS - 1)) << _COEFFICIENT_BITS
    return float(coefficient) * 2.0 ** (exponent - _COEFFICIENT_BITS)
