"""The page for the people at the robot says what the table says."""

from __future__ import annotations

from pathlib import Path

import pytest

import common
from deploy.experiments.faults.document import BEGIN, END, within_page, words
from deploy.harness.faults.table import FAULTS

ROOT = Path(common.__file__).parents[1]
PAGE = ROOT / "docs" / "when-something-fails.md"
ROWS = list(FAULTS.values())


def lines() -> list[str]:
    page = PAGE.read_text("utf-8")
    return page[page.index(BEGIN) : page.index(END)].splitlines()


def test_the_page_has_each_row_with_its_bounds_and_no_other() -> None:
    rows = [line for line in lines() if line.startswith("| **")]
    assert sorted(rows) == sorted("| " + " | ".join(words(row)) + " |" for row in ROWS)


def test_each_row_has_its_figures() -> None:
    measured = lines()[lines().index("## Measured") :]
    assert [
        row.name for row in ROWS if not any(line.startswith(f"| {row.name} | ") for line in measured)
    ] == []


def test_what_is_missed_is_on_the_page() -> None:
    page = PAGE.read_text("utf-8")
    assert all(row.missed in page for row in ROWS)


def test_a_page_without_marks_is_refused() -> None:
    with pytest.raises(ValueError, match="substring"):
        within_page("# nothing", "")
