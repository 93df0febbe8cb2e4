"""Every fault has its entry in the risk file, and every test that the file names exists."""

from __future__ import annotations

import csv
import io
import json
import subprocess
import sys
from pathlib import Path

import pytest

import common
from common.errors import TandemError
from deploy.experiments.faults import hazard_table
from deploy.experiments.faults.hazard_table import (
    BEGIN,
    END,
    as_csv,
    hazard_row,
    required,
    tried_by,
    write_hazards,
)
from deploy.harness.faults.hazards import CONTROLS, HAZARDS, RISKS
from deploy.harness.faults.table import FAULTS
from deploy.harness.faults.virtual import try_on_virtual_clock
from tests.fault_matrix.test_matrix import TABLE

ROOT = Path(common.__file__).parents[1]
PAGE = ROOT / "docs" / "hazards.md"


def test_every_row_of_the_fault_table_has_its_entry_and_no_other_has() -> None:
    missing = [name for name in FAULTS if name not in RISKS]
    assert missing == [], "give each an id, a hazard and controls in deploy/harness/faults/hazards.py"
    assert sorted(RISKS) == sorted(FAULTS)


def test_ids_are_unique_and_every_hazard_and_control_is_known_and_used() -> None:
    ids = [entry.id for entry in RISKS.values()]
    assert len(set(ids)) == len(ids)
    assert {entry.hazard for entry in RISKS.values()} == set(HAZARDS)
    assert {control for entry in RISKS.values() for control in entry.controls} == set(CONTROLS)
    assert all(entry.controls for entry in RISKS.values())


def test_every_test_that_is_named_exists() -> None:
    named = {*map(tried_by, FAULTS.values()), *CONTROLS.values()}
    files = sorted({name.partition("::")[0] for name in named})
    said = subprocess.run(
        [sys.executable, "-m", "pytest", "--collect-only", "-q", "-p", "no:cacheprovider", *files],
        cwd=ROOT, capture_output=True, text=True, check=False,
    ).stdout  # fmt: skip
    there = [line for line in said.splitlines() if "::" in line]
    assert len(there) > len(FAULTS), said[-2000:]
    wanted = {name if name.endswith("]") else name.rstrip() for name in named}
    assert sorted(n for n in wanted if not any(_is(n, line) for line in there)) == []


def _is(name: str, collected: str) -> bool:
    """A whole file, a test with any parameters, or one test."""
    return collected == name or collected.startswith((f"{name}::", f"{name}["))


def test_the_page_has_each_row_with_its_bounds_and_a_figure_and_no_other() -> None:
    page = PAGE.read_text("utf-8")
    part = page[page.index(BEGIN) : page.index(END)]
    rows = [line.strip("| ").split(" | ") for line in part.splitlines() if line.startswith("| F")]
    expected = [
        [entry.id, entry.hazard, name, ", ".join(entry.controls), required(FAULTS[name])]
        for name, entry in sorted(RISKS.items(), key=lambda item: item[1].id)
    ]
    assert [row[:5] for row in rows] == expected
    assert all(any(digit.isdigit() for digit in row[5]) for row in rows)
    assert all(f"| {hazard} | {words} |" in part for hazard, words in HAZARDS.items())
    assert all(f"| {control} | `{test}` |" in part for control, test in CONTROLS.items())


def test_one_trial_as_page_csv_and_json(tmp_path: Path) -> None:
    outcome = try_on_virtual_clock(TABLE["stop button"])
    row = hazard_row(outcome)
    assert row.passed
    assert row.measured.startswith("decided in 0.00 s, stood in 0.2")
    (read,) = csv.DictReader(io.StringIO(as_csv([row])))
    assert read["controls"].split("; ") == list(row.controls)
    file = tmp_path / "hazards.json"
    write_hazards(file, [outcome])
    (tree,) = json.loads(file.read_text("utf-8"))
    assert (tree["id"], tree["test"]) == ("F50", tried_by(outcome.fault))
    page = tmp_path / "hazards.md"
    page.write_text(f"before\n{BEGIN}\nold\n{END}\nafter\n", "utf-8")
    write_hazards(page, [outcome])
    assert page.read_text("utf-8").startswith(f"before\n{BEGIN}")
    assert "| F50 | H7 | stop button | " in page.read_text("utf-8")
    with pytest.raises(TandemError, match="expected a name that ends in"):
        write_hazards(tmp_path / "hazards.txt", [outcome])


def test_a_row_without_an_entry_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    outcome = try_on_virtual_clock(TABLE["stop button"])
    monkeypatch.setattr(hazard_table, "RISKS", {})
    with pytest.raises(TandemError, match="has no entry"):
        hazard_row(outcome)
