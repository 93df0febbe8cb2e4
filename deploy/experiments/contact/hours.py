"""`tandem contact --hours`: the ways through the air with progress, as a table, and judged."""

from __future__ import annotations

import hashlib
from dataclasses import asdict
from pathlib import Path

from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from deploy.experiments.contact.flight import Flight
from deploy.experiments.contact.flights import LOADS, Flights, fly, motions_of
from deploy.experiments.contact.progress import FlightProgress
from deploy.harness.code_state import code_state
from deploy.measure.verdict import Verdict, at_most
from deploy.report.tables import number, plain_table


def follow_for(
    hours: float,
    person: Path | None,
    seed: int,
    console: Console,
    jobs: int = 1,
    resume: Path | None = None,
) -> tuple[list[Table], dict[str, object], list[Verdict]]:
    """Follow all motions for so long with each load: tables, JSON tree, verdicts.

    `resume`: the file of what is done. Raises RecordingError where the person's file cannot be read, and
    ConfigError where that file is of another run or by other code.
    """
    motions, seconds = motions_of(person), 3600.0 * hours
    whose = None if person is None else hashlib.sha256(person.read_bytes()).hexdigest()[:16]
    done = FlightProgress({"code": code_state(), "hours": hours, "seed": seed, "person": whose}, resume)
    done.resume()
    with Progress(console=console, transient=True) as progress:
        task = progress.add_task("through the air", total=seconds * len(LOADS))
        found = fly(motions, seconds, seed, lambda flown_s: progress.advance(task, flown_s), jobs, done)
    return [flights_table(found.flights), pipeline_table(found)], flights_tree(found), judge_flights(found)


def flights_table(flights: tuple[Flight, ...]) -> Table:
    """One row a motion, kind of readings and load."""
    table = plain_table("motion", "readings", "carries", "s", "robots", "stops", "nearest", "at")
    for one in flights:
        table.add_row(
            one.motion,
            one.readings,
            one.load,
            number(one.seconds, 0),
            str(len(one.laps)),
            str(len(one.findings)),
            number(one.worst.nearest, 2),
            one.worst.joint,
        )
    table.caption = "nearest: largest torque from outside, as a share of its threshold"
    return table


def pipeline_table(found: Flights) -> Table:
    """One row a motion: what the whole pipeline did."""
    table = plain_table("by the whole pipeline", "followed s", "false stops", "other stops")
    for name, one in found.by_pipeline.items():
        table.add_row(
            name, number(one.followed_s, 0), str(len(one.false_stops)), "; ".join(one.other_stops) or "0"
        )
    return table


def flights_tree(found: Flights) -> dict[str, object]:
    """The JSON object."""
    flights = [
        {
            "motion": one.motion,
            "readings": one.readings,
            "load": one.load,
            "seconds": one.seconds,
            "robots": len(one.laps),
            "stops": one.findings,
            "nearest": one.worst.nearest,
            "joint": one.worst.joint,
        }
        for one in found.flights
    ]
    return {"flights": flights, "by_pipeline": {name: asdict(one) for name, one in found.by_pipeline.items()}}


def judge_flights(found: Flights) -> list[Verdict]:
    """False stops by load; stops of other watches."""
    verdicts = []
    for load in dict.fromkeys(one.load for one in found.flights):
        flown = [one for one in found.flights if one.load == load]
        stops, hours = sum(len(one.findings) for one in flown), sum(one.seconds for one in flown) / 3600.0
        name = f"false stops, the hand holds {load}"
        verdicts.append(at_most(name, float(stops), 0.0, why=f"{hours:.3g} simulated hours"))
    whole = found.by_pipeline.values()
    verdicts.append(
        at_most("false stops, whole pipeline", float(sum(len(o.false_stops) for o in whole)), 0.0)
    )
    verdicts.append(
        at_most("stops for other reasons", float(sum(len(one.other_stops) for one in whole)), 0.0)
    )
    return verdicts
