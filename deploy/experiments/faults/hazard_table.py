"""The hazard table: hazard → control → test → figure, as a page, CSV or JSON for a hospital's risk file."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from common.errors import TandemError
from deploy.experiments.faults.document import bound, figures, table
from deploy.harness.faults.fault import FaultRow, Reaction
from deploy.harness.faults.hazards import CONTROLS, HAZARDS, PROCESS_TEST, RISKS, VIRTUAL_TEST
from deploy.harness.faults.judge import FaultOutcome
from deploy.harness.faults.processes import ProcessFault

BEGIN = "<!-- the hazards: written by `tandem faults --hazards` -->"
END = "<!-- end of the hazards -->"


@dataclass(frozen=True, slots=True)
class HazardRow:
    """One fault: what may happen, what holds it off, how that is tested, and what came of it."""

    id: str
    hazard: str
    fault: str
    controls: tuple[str, ...]
    required: str
    test: str
    control_tests: tuple[str, ...]
    measured: str
    passed: bool


def hazard_row(outcome: FaultOutcome) -> HazardRow:
    """The row of one trial. Raises TandemError where its fault has no entry in `hazards.py`."""
    fault = outcome.fault
    if fault.name not in RISKS:
        raise TandemError(f"the fault {fault.name!r} has no entry in deploy/harness/faults/hazards.py")
    entry = RISKS[fault.name]
    return HazardRow(
        id=entry.id,
        hazard=f"{entry.hazard}: {HAZARDS[entry.hazard]}",
        fault=f"{fault.name}: {fault.done}",
        controls=entry.controls,
        required=required(fault),
        test=tried_by(fault),
        control_tests=tuple(CONTROLS[control] for control in entry.controls),
        measured=measured(outcome),
        passed=not outcome.wrong,
    )


def tried_by(fault: FaultRow) -> str:
    """The id of the test that tries a row, as pytest takes it."""
    return (PROCESS_TEST if isinstance(fault, ProcessFault) else VIRTUAL_TEST).format(fault.name)


def required(fault: FaultRow) -> str:
    """What the robot must do, and within which bounds."""
    return f"{fault.reaction}: {bound(fault)}"


def measured(outcome: FaultOutcome) -> str:
    """The figures of one trial that its bounds are about."""
    _, reacted, stood, peak, _, _, strayed = figures(outcome)
    if outcome.fault.stands_s is not None:
        decided = f"decided in {reacted} s, " if outcome.fault.reacts_s is not None else ""
        return f"{decided}stood in {stood} s"
    return (
        f"at most {peak.replace(' ', ' °/s ', 1)}"
        if outcome.fault.reaction is Reaction.LIMITED
        else f"{strayed}° off"
    )


def write_hazards(path: Path, outcomes: Sequence[FaultOutcome]) -> None:
    """Write a `.md` page (between its marks), `.csv` or `.json`. Raises TandemError, OSError, ValueError."""
    rows = sorted((hazard_row(outcome) for outcome in outcomes), key=lambda row: row.id)
    match path.suffix:
        case ".json":
            path.write_text(json.dumps([asdict(row) for row in rows], indent=2) + "\n", "utf-8")
        case ".csv":
            path.write_text(as_csv(rows), "utf-8")
        case ".md":
            page = path.read_text("utf-8")
            before, after = page[: page.index(BEGIN)], page[page.index(END) + len(END) :]
            path.write_text(before + as_page(rows) + after, "utf-8")
        case _:
            raise TandemError(f"{path}: expected a name that ends in .md, .csv or .json")


def as_csv(rows: Sequence[HazardRow]) -> str:
    """One line a row, with a head; lists joined by semicolons."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(HazardRow.__dataclass_fields__)
    for row in rows:
        cells = asdict(row).values()
        writer.writerow(["; ".join(cell) if isinstance(cell, tuple) else cell for cell in cells])
    return out.getvalue()


def as_page(rows: Sequence[HazardRow]) -> str:
    """Three tables between the marks: hazards, faults with their controls, and each control's own test."""
    used = sorted({control for row in rows for control in row.controls})
    return "\n\n".join(
        [
            BEGIN,
            table(("hazard", "what may happen"), HAZARDS.items()),
            "## Faults, controls and figures",
            table(("id", "hazard", "fault", "controls", "required", "measured"), map(cells, rows)),
            "## Each control's own test",
            "It fails once the control is taken away.",
            table(("control", "test"), [(control, f"`{CONTROLS[control]}`") for control in used]),
            END,
        ]
    )


def cells(row: HazardRow) -> tuple[str, ...]:
    """Of the page's middle table."""
    fault, hazard = row.fault.partition(":")[0], row.hazard.partition(":")[0]
    figure = row.measured if row.passed else f"**not kept**: {row.measured}"
    return row.id, hazard, fault, ", ".join(row.controls), row.required, figure
