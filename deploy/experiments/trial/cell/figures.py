"""What is measured of a cell, as data: name, unit, digits, which way is better, and what it means."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

Values = Mapping[str, float | None]
"""A cell's figures by name; None where it could not be measured."""


@dataclass(frozen=True, slots=True)
class CellMetric:
    """One figure."""

    name: str
    title: str
    unit: str
    digits: int
    """After the point: what a report prints, and what its JSON is rounded to."""
    group: str
    meaning: str
    """The report's footnote."""


LATENCY, TRIP, MOTION, GUARD, OUTAGE, COST = "latency", "trip", "motion", "guard", "outage", "cost"

FIGURES = (
    CellMetric("one_way_p50_ms", "one-way p50", "ms", 1, LATENCY,
           "put → received, of every command that arrived in the judged time, by the clock offset that was "
           "measured then"),
    CellMetric("one_way_p99_ms", "one-way p99", "ms", 1, LATENCY, "the same, 99th percentile"),
    CellMetric("one_way_corrected_p99_ms", "with the missing, p99", "ms", 1, LATENCY,
           "the same over every command that was due, also those that never came or were never sent: how "
           "long the robot went without what they had to say (correction for coordinated omission)"),
    CellMetric("one_way_bound_ms", "bound ±", "ms", 1, LATENCY,
           "how wrong the clock offset can make a one-way figure at most: half the least round trip, "
           "plus drift; or what both hosts' time services state, where that is narrower"),
    CellMetric("true_one_way_p50_ms", "true p50", "ms", 1, LATENCY,
           "one-way of accepted commands by the one clock that both namespaces share: a check of the "
           "bound that two real hosts do not have"),
    CellMetric("true_one_way_p99_ms", "true p99", "ms", 1, LATENCY, "the same, 99th percentile"),
    CellMetric("round_trip_p50_ms", "round trip p50", "ms", 1, TRIP,
           "command put → its echo heard, in the judged time, on the master's clock, without the time the "
           "robot held it"),
    CellMetric("round_trip_p99_ms", "round trip p99", "ms", 1, TRIP, "the same, 99th percentile"),
    CellMetric("age_p50_ms", "age p50", "ms", 1, TRIP,
           "age at the servo: the operator stood so → the setpoint that first uses it is written"),
    CellMetric("age_p99_ms", "age p99", "ms", 1, TRIP, "the same, 99th percentile"),
    CellMetric("delivered", "delivered", "%", 1, TRIP,
           "commands that reached the robot, of those that were due by their numbers and by time"),
    CellMetric("accepted", "accepted", "%", 1, TRIP,
           "commands that the guard accepted, of those sent; the rest was lost, stale or overtaken"),
    CellMetric("rmse_deg", "RMSE", "°", 2, MOTION,
           "same-instant tracking error: encoders against the operator's true angles at the same moment, "
           "over the joints that move: what the patient sees"),
    CellMetric("rmse_over_latest", "RMSE / latest", "", 3, MOTION,
           "that error divided by the error of the strategy latest, for the same commands at the same "
           "arrival times"),
    CellMetric("lag_ms", "motion lag", "ms", 0, MOTION,
           "the shift in time that makes robot and operator fit best; negative: the robot is early"),
    CellMetric("aligned_rmse_deg", "aligned RMSE", "°", 2, MOTION,
           "the error that is left when the lag is taken out"),
    CellMetric("roughness", "roughness", "", 2, MOTION,
           "RMS acceleration of the robot over the operator's; 1 is as smooth as the operator"),
    CellMetric("eta_percent", "η", "%", 2, MOTION,
           "the paper's dynamic error (Eq. 25) of the solved angles, the worse arm; the network has no "
           "part in it; withheld below 95 % estimated"),
    CellMetric("estimated", "estimated", "%", 1, MOTION,
           "share of the joints' angles that were estimated, of the joint with the least"),
    CellMetric("tracked", "tracked", "%", 1, GUARD, "share of the judged time in which the robot followed"),
    CellMetric("holds", "holds", "", 0, GUARD,
           "times that the guard left track during the judged time; the operator then engaged again"),
    CellMetric("refused", "refused", "", 0, GUARD, "commands that arrived and were refused by a gate"),
    CellMetric("clamps", "clamps", "", 0, GUARD,
           "times that a joint was given less than was asked, by any limit"),
    CellMetric("held_s", "cut → hold", "s", 2, OUTAGE,
           "the link is cut → the robot holds, by itself; its time-out is 0.2 s without a command"),
    CellMetric("flow_s", "flow after outage", "s", 2, OUTAGE,
           "the link returns → the guard accepts the first command"),
    CellMetric("stale_accepted", "stale accepted", "", 0, OUTAGE,
           "commands accepted after the return that were older than the guard may take, by the shared "
           "clock; none may be. Of several between two states (20 ms) only the last is seen: of the others "
           "as many count as the robot's own counter proves"),
    CellMetric("stale_refused", "stale refused", "", 0, OUTAGE,
           "commands that the guard refused for their age from the cut on"),
    CellMetric("moved_alone", "moved alone", "", 0, OUTAGE,
           "1 where the robot left hold before the operator's act; it must not"),
    CellMetric("blind_farthest_cm", "blind way", "cm", 1, OUTAGE,
           "how far a hand still went after the last command before a hold for want of commands, at the "
           "encoders"),
    CellMetric("blind_share", "blind way / foretold", "", 2, OUTAGE,
           "that way over the one that the robot had foretold with that command, median of hands that were "
           "to go 2 cm or more"),
    CellMetric("blind_excess_cm", "blind way beyond foretold", "cm", 2, OUTAGE,
           "that way less the one foretold, of the worst hand; it must not be above 0"),
    CellMetric("ready_s", "ready after outage", "s", 2, OUTAGE,
           "the link returns → the operator holds the lease and may engage"),
    CellMetric("track_again_s", "act → track", "s", 2, OUTAGE,
           "the operator engages → the robot follows again"),
    CellMetric("cpu_master", "CPU master", "%", 1, COST, "of one core, while judged"),
    CellMetric("cpu_slave", "CPU slave", "%", 1, COST,
           "of one core, while judged, the simulated robot included"),
    CellMetric("cpu_router", "CPU router", "%", 1, COST, "of one core, where there is one"),
    CellMetric("up_kb_s", "to robot", "kB/s", 2, COST,
           "bytes on the wire per second, operator → robot, headers and acknowledgements included"),
    CellMetric("down_kb_s", "from robot", "kB/s", 2, COST, "the same, robot → operator"),
    CellMetric("ticks_missed", "ticks missed", "%", 2, COST,
           "of the master's and slave's loops, the worse: of a machine that misses many, distrust every "
           "figure"),
)  # fmt: skip
"""In the order of the report."""

BY_NAME = {figure.name: figure for figure in FIGURES}


def rounded(values: Values) -> dict[str, float | None]:
    """Every figure once, rounded as it is printed, so that reports of equal runs are equal files.

    Raises KeyError for a name that is no figure's.
    """
    foreign = values.keys() - BY_NAME.keys()
    if foreign:
        raise KeyError(f"no figures: {', '.join(sorted(foreign))}")
    return {f.name: _round(values.get(f.name), f.digits) for f in FIGURES}


def printed(name: str, value: float | None, unit: bool = False) -> str:
    """The value for people; a dash where it is unknown."""
    figure = BY_NAME[name]
    if value is None:
        return "–"
    text = f"{value:.{figure.digits}f}".replace("-", "−")
    if not unit or not figure.unit:
        return text
    return text + (figure.unit if figure.unit in "°%" else f" {figure.unit}")


def _round(value: float | None, digits: int) -> float | None:
    # `+ 0.0` makes of -0.0, which prints otherwise, 0.0
    return None if value is None else round(value, digits) + 0.0
