"""The fault matrix as a page for people at the robot: words from the table, figures as measured."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence

from deploy.harness.faults.fault import FaultRow
from deploy.harness.faults.judge import FaultOutcome

BEGIN = "<!-- the matrix: written by `tandem faults --page` -->"
END = "<!-- end of the matrix -->"
WORDS_HEAD = ("what fails", "what the robot does", "within", "what you do")
FIGURES_HEAD = (
    "what fails",
    "reacted, s",
    "stood, s",
    "peak speed, °/s",
    "way, °",
    "overshoot, °",
    "strayed, °",
)
_NONE = "–"


def matrix(outcomes: Sequence[FaultOutcome], lacking: Mapping[str, str] | None = None) -> str:
    """Both tables, between the marks. `lacking`: rows that do not apply to the robot, with what it lacks."""
    unapplied = [
        (f"**{name}**", f"does not apply: {why}", _NONE, _NONE) for name, why in (lacking or {}).items()
    ]
    missed = [f"- **{o.fault.name}**: {o.fault.missed}" for o in outcomes if o.fault.missed]
    parts = [
        BEGIN,
        table(WORDS_HEAD, [*(words(outcome.fault) for outcome in outcomes), *unapplied]),
        "## Measured",
        "At the 12-bit encoders of the simulated robot, on a clock that is simulated too, so that everybody "
        "gets the same; where a program is killed, the encoders of simulated CANopen drives in real time. "
        "*reacted*: the guard had come to its decision. *stood*: no joint moved any more. *way*: how far a "
        "joint still turned after the fault. *overshoot*: how far it went beyond where it was to stop. "
        "*strayed*: how far joints that were to go on were from where they would have been.",
        table(FIGURES_HEAD, (figures(outcome) for outcome in outcomes)),
        *(["## Not kept yet", "\n".join(missed)] if missed else []),
        END,
    ]
    return "\n\n".join(parts)


def within_page(page: str, part: str) -> str:
    """The page with what stands between the marks replaced. Raises ValueError where it has no marks."""
    before, rest = page[: page.index(BEGIN)], page[page.index(END) + len(END) :]
    return before + part + rest


def words(fault: FaultRow) -> tuple[str, ...]:
    """What, reaction, bound, and what a person does."""
    return (f"**{fault.name}**: {fault.done}", fault.robot, bound(fault), fault.person)


def bound(fault: FaultRow) -> str:
    """The limits of the reaction as text: time to decide, time to stand still, deviation."""
    if fault.stands_s is None:
        return "all the time" if fault.strays_deg is None else f"never more than {fault.strays_deg:g}° off"
    decided = "" if fault.reacts_s is None else f"decides in {fault.reacts_s:g} s, "
    return f"{decided}stands in {fault.stands_s:.2g} s"


def figures(outcome: FaultOutcome) -> tuple[str, ...]:
    """Of one trial, as cells."""
    fault, measured = outcome.fault, outcome.stillness
    stands = fault.stands_s is not None
    moved = _degrees(measured.peak_speed_rad_s, 0)
    share = f"{moved} ({measured.peak_share:.0%} of {measured.peak_joint}'s limit)"
    return (
        fault.name,
        _seconds(outcome.reacted_s if fault.reacts_s is not None else None),
        _seconds(measured.standstill_s if stands else None),
        share,
        _degrees(measured.way_rad, 1) if stands else _NONE,
        _degrees(measured.overshoot_rad, 2) if stands else _NONE,
        _NONE if outcome.strayed_rad is None else _degrees(outcome.strayed_rad, 1),
    )


def tree(outcome: FaultOutcome) -> dict[str, object]:
    """Of one trial, as plain values for a report."""
    measured = outcome.stillness
    return {
        "fault": outcome.fault.name,
        "expected": str(outcome.fault.reaction),
        "kept": not outcome.wrong,
        "wrong": list(outcome.wrong),
        "guard": outcome.state,
        "reason": outcome.reason,
        "reacted_s": outcome.reacted_s,
        "stood_s": measured.standstill_s if outcome.fault.stands_s is not None else None,
        "peak_joint": measured.peak_joint,
        "peak_deg_s": math.degrees(measured.peak_speed_rad_s),
        "peak_share_of_limit": measured.peak_share,
        "way_deg": math.degrees(measured.way_rad),
        "overshoot_deg": math.degrees(measured.overshoot_rad),
        "strayed_deg": None if outcome.strayed_rad is None else math.degrees(outcome.strayed_rad),
        "refused": outcome.refused,
    }


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A Markdown table."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(cells) + " |" for cells in lines)


def _degrees(angle_rad: float, digits: int) -> str:
    return f"{math.degrees(angle_rad):.{digits}f}"


def _seconds(time_s: float | None) -> str:
    return _NONE if time_s is None else f"{time_s:.2f}"
