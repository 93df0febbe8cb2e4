"""The meetings that are tried, each with and without detection."""

from __future__ import annotations

from dataclasses import dataclass

from deploy.sim.patient.impact import PLACES, Impact, meet
from deploy.sim.patient.robot import Imperfect
from slave.contact.config import Reflex

SPEEDS_M_S = (0.25, 0.5, 1.0)


@dataclass(frozen=True, slots=True)
class Meeting:
    """What meets whom, and how fast."""

    place: str
    speed_m_s: float
    clamped: bool


MEETINGS = tuple(
    Meeting(place, speed, clamped) for clamped in (False, True) for place in PLACES for speed in SPEEDS_M_S
)


@dataclass(frozen=True, slots=True)
class Pair:
    """One meeting, not noticed and noticed."""

    meeting: Meeting
    without: Impact
    with_detection: Impact

    @property
    def ratio(self) -> float:
        """Peak force with detection, share of that without."""
        return self.with_detection.peak_n / self.without.peak_n

    @property
    def detection_s(self) -> float | None:
        """From the crossing of a threshold to the protective stop; None where either did not happen."""
        seen = self.with_detection
        if seen.noticed_s is None or seen.crossed_s is None:
            return None
        return seen.noticed_s - seen.crossed_s


def pair(meeting: Meeting, reflex: Reflex, drive_bits: int) -> Pair:
    """Try one meeting twice."""
    imperfect = Imperfect(drive_bits=drive_bits)
    without, seen = (
        meet(
            PLACES[meeting.place],
            meeting.speed_m_s,
            clamped=meeting.clamped,
            reflex=chosen,
            imperfect=imperfect,
        )
        for chosen in (None, reflex)
    )
    return Pair(meeting, without, seen)
