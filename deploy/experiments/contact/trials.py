"""The meetings that are tried, each with and without detection; the motions that are followed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from common.skeleton import load_skeleton
from deploy.sim.patient.free_run import FreeRun, free_run, of_motion, of_person
from deploy.sim.patient.impact import PLACES, Impact, meet
from deploy.sim.patient.robot import Imperfect
from slave.contact.config import ContactConfig, Reflex

SPEEDS_M_S = (0.25, 0.5, 1.0)
MASS_SHARE = 0.05
"""By so much the masses of the robot that follows through the air differ from its model's."""


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


def fly(seconds: float, payload_kg: float, drive_bits: int, person: Path | None) -> Mapping[str, FreeRun]:
    """Follow each motion through the air for so long."""
    skeleton = load_skeleton("nursing")
    motions = {name: of_motion(name, skeleton) for name in ("bottle", "sweep")}
    if person is not None:
        motions[person.name] = of_person(person, skeleton)
    imperfect = Imperfect(mass_share=MASS_SHARE, payload_kg=payload_kg, drive_bits=drive_bits)
    return {name: free_run(moves, seconds, imperfect, ContactConfig()) for name, moves in motions.items()}
