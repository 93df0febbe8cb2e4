"""Long ways through the air: each motion, robots that differ, loads that are declared or not."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from common.quaternion import Array
from common.skeleton import load_skeleton
from deploy.experiments.contact.flight import Flight
from deploy.experiments.contact.progress import FlightProgress
from deploy.harness.workers import OnProgress, run_each
from deploy.sim.patient.free_run import FreeFlight, FreeRun, RecordedPeople, of_motion
from deploy.sim.patient.operator import TICK_NS, Moves
from deploy.sim.patient.replay import Lap, held, replay
from deploy.sim.patient.robot import Imperfect
from slave.contact.config import ContactConfig

MOTIONS = ("bottle", "sweep", "crossed")
PERSON = "person"
LONGEST_S = 700.0
"""Of one way: a motion repeats after less, and 61 recorded clips of people take 695 s."""
MOST_OF_PEOPLE = 0.75
"""People's recording is followed from end to end where that takes no more than this share of the time."""
MASS_SHARE, PAYLOAD_KG = 0.05, 0.5
READINGS: Mapping[str, Imperfect] = {
    "12 bits": Imperfect(mass_share=MASS_SHARE),
    "16 bits": Imperfect(mass_share=MASS_SHARE, drive_bits=16),
    "CANopen": Imperfect(
        mass_share=MASS_SHARE, drive_bits=16, cycles_a_reading=5, late_cycles=0, stamp_error_s=3e-4
    ),
}
"""What the observer has: output encoders; drives' own; those at 50 SYNCs a second, stamped 0.3 ms wrong."""
NOTHING, DECLARED = "nothing", "0.5 kg, declared"
LOADS = (NOTHING, DECLARED)
"""In the right hand."""


@dataclass(frozen=True, slots=True)
class Flights:
    """All of them."""

    by_pipeline: Mapping[str, FreeRun]
    """Each motion once, by the slave's whole pipeline."""
    flights: tuple[Flight, ...]


def motions_of(person: Path | None) -> dict[str, Moves]:
    """The motions by name. Raises RecordingError where the person's file cannot be read."""
    skeleton = load_skeleton("nursing")
    motions = {name: of_motion(name, skeleton) for name in MOTIONS}
    return motions if person is None else {**motions, PERSON: RecordedPeople(person, skeleton)}


def shares_s(motions: Mapping[str, Moves], seconds: float) -> dict[str, float]:
    """How long each motion is followed, `seconds` together: alike, but people's recording whole."""
    alike_s = seconds / len(motions)
    whole = {
        name: max(alike_s, min(moves.seconds, MOST_OF_PEOPLE * seconds))
        for name, moves in motions.items()
        if isinstance(moves, RecordedPeople)
    }
    if len(whole) == len(motions):
        return dict.fromkeys(motions, alike_s)
    rest_s = (seconds - sum(whole.values())) / (len(motions) - len(whole))
    return {name: whole.get(name, rest_s) for name in motions}


@dataclass(frozen=True, slots=True)
class _Task:
    """One flight to come: its way, tick by tick, for so many ticks."""

    motion: str
    readings: str
    load: str
    way: Array
    ticks: int
    seeds: tuple[int, int]
    """The first lap's, and by how much each further one's is more."""


def fly(
    motions: Mapping[str, Moves],
    seconds: float,
    seed: int,
    flown: Callable[[float], None] = lambda s: None,
    jobs: int = 1,
    progress: FlightProgress | None = None,
) -> Flights:
    """Follow all motions by each kind of readings, `seconds` together, with each load; see `shares_s`.

    Every lap is a robot with other masses and other noise. `flown` gets the seconds of each flight. `jobs`
    processes replay ways; what `progress` has already is not flown again.
    """
    done = progress or FlightProgress({})
    shares = shares_s(motions, seconds / len(READINGS))
    every = list(itertools.product(LOADS, READINGS, motions))
    left = [key for key in every if key not in done.flights]
    for key in every:
        if key not in left:
            flown(done.flights[key].seconds)
    ways: dict[str, Array] = {}
    for name, moves in motions.items():
        if name in done.by_pipeline and all(motion != name for _, _, motion in left):
            continue
        flight = FreeFlight(moves, Imperfect(mass_share=MASS_SHARE, seed=seed), ContactConfig())
        flight.follow(min(shares[name], LONGEST_S))
        ways[name] = flight.setpoints_rad
        done.followed(name, flight.found)
    tasks = [
        _Task(
            name, readings, load, ways[name], max(1, round(shares[name] * 1e9 / TICK_NS)),
            (seed + every.index((load, readings, name)), len(every)),
        )
        for load, readings, name in left
    ]  # fmt: skip
    for _, made in run_each(_flight, tasks, jobs):
        done.flew(made)
        flown(made.seconds)
    return Flights(
        {name: done.by_pipeline[name] for name in motions}, tuple(done.flights[key] for key in every)
    )


def _flight(task: _Task, tell: OnProgress) -> Flight:
    laps: list[Lap] = []
    left, (seed, step) = task.ticks, task.seeds
    while left > 0:
        way = task.way[:left]
        laps.append(_lap(way, task.readings, task.load, seed))
        left, seed = left - len(way), seed + step
    return Flight(task.motion, task.readings, task.load, tuple(laps))


def _lap(way: Array, readings: str, load: str, seed: int) -> Lap:
    payload_kg = 0.0 if load == NOTHING else PAYLOAD_KG
    imperfect = replace(READINGS[readings], payload_kg=payload_kg, seed=seed)
    return replay(way, imperfect, ContactConfig(), held(PAYLOAD_KG) if load == DECLARED else None)
