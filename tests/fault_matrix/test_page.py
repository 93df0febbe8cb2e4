"""The page for the people at the robot says what the table says."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import common
from deploy.experiments.faults.document import BEGIN, END, within_page, words
from deploy.harness.faults.fault import FaultRow
from deploy.harness.faults.table import FAULTS

ROOT = Path(common.__file__).parents[1]
PAGE = ROOT / "docs" / "when-something-fails.md"
ROWS = list(FAULTS.values())


def lines() -> list[str]:
    page = PAGE.read_text("utf-8")
    return page[page.index(BEGIN) : page.index(END)].splitlines()


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row.name)
def test_each_row_is_on_the_page_with_its_bounds(row: FaultRow) -> None:
    assert "| " + " | ".join(words(row)) + " |" in lines()


def test_the_page_has_no_other_rows() -> None:
    assert sum(line.startswith("| **") for line in lines()) == len(ROWS)


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


def test_no_time_out_counts_by_the_wall_clock() -> None:
    """The date of a host may be set at any time: only recordings and logs read it."""
    reads = re.compile(r"\btime\.time(_ns)?\(|\bdatetime\.(now|utcnow|today)\(|from time import .*\btime\b")
    sources = [p for folder in ("common", "master", "slave") for p in (ROOT / folder).rglob("*.py")]
    assert len(sources) > 50
    users = {p.relative_to(ROOT).as_posix() for p in sources if reads.search(p.read_text("utf-8"))}
    # a certificate is valid from one date to another: read once, before anything is opened
    allowed = {"common/link/certificates.py"}
    assert {u for u in users - allowed if not u.startswith("common/recording/")} == set()
