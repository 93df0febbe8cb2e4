"""Whether a drive stands where it reports, checked before it may be enabled. Pure.

A drive is enabled at the position that it reports, and every later target counts from there. So that position
must be confirmed first: by the encoder at the output shaft or, where that is not valid, by the last known
position.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from slave.encoders.agreement import WINDOW_RAD
from slave.servos.canopen.status_bits import wrong_bits

CHECKED_SYNCS = 5
"""Answers, standing still, after which a drive may be enabled. Two drives of one id show by then."""
SLACK_RAD = math.radians(0.1)
"""At a software limit a drive may stand this far beyond it: encoders flicker."""
LAST_KNOWN_RAD = math.radians(5.0)
"""A joint that was not turned while it was off stands within this of its last angle."""


@dataclass(frozen=True, slots=True)
class JointPlace:
    """Where one joint stands, by each source, rad."""

    drive_rad: float
    """The angle by the drive."""
    encoder_rad: float | None
    """The angle by the output encoder; None if its word is not valid."""
    last_known_rad: float | None
    """Before the robot was switched off; None where that is not known."""
    limits_rad: tuple[float, float]
    """The drive's software limits."""
    increments_per_rad: float
    zero_increments: int
    single: bool = False
    """Whether the drive alone tells the angle; the guard then asks for the last known one, or a person."""


def refusal(place: JointPlace, statusword: int) -> str:
    """A text for why a drive may not be enabled; empty if it may."""
    return _bits(statusword) or _reference(place) or _range(place)


def _bits(statusword: int) -> str:
    wrong = wrong_bits(statusword, enabled=False)
    return f"is not ready: {wrong}" if wrong else ""


def _range(place: JointPlace) -> str:
    lower, upper = place.limits_rad
    beyond = max(lower - place.drive_rad, place.drive_rad - upper)
    if beyond <= SLACK_RAD:
        return ""
    return (
        f"stands at {_deg(place.drive_rad)}, {_deg(beyond)} beyond its software limits of {_deg(lower)} to "
        f"{_deg(upper)}: enabled, it would jump to them; turn the joint back by hand, or correct the limits"
    )


def _reference(place: JointPlace) -> str:
    if place.single:
        return ""
    if place.encoder_rad is not None:
        return _by_encoder(place, place.encoder_rad)
    if place.last_known_rad is None:
        return (
            f"reports {_deg(place.drive_rad)}, which nothing confirms: its output encoder gives no valid "
            "angle, and no last position is known; repair the encoder"
        )
    if abs(place.drive_rad - place.last_known_rad) <= LAST_KNOWN_RAD:
        return ""
    return (
        f"reports {_deg(place.drive_rad)}, but the joint's last known angle is "
        f"{_deg(place.last_known_rad)}, and its output encoder gives no valid angle; repair the encoder"
    )


def _by_encoder(place: JointPlace, encoder_rad: float) -> str:
    off = place.drive_rad - encoder_rad
    if abs(off) <= WINDOW_RAD:
        return ""
    zero = round(place.zero_increments + off * place.increments_per_rad)
    return (
        f"reports {_deg(place.drive_rad)}, its output encoder {_deg(encoder_rad)}: the drive has lost its "
        "turns, or its zero, gear ratio or direction is wrong, or the encoder is; look at the joint: if only "
        f"the drive's zero is wrong, set zero_increments = {zero}"
    )


def _deg(angle_rad: float) -> str:
    return f"{math.degrees(angle_rad):.1f}°"
