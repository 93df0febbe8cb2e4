"""docs/verdicts.md lists every verdict, and every test that it names exists."""

from __future__ import annotations

import ast
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import pytest

from tests.deploy.experiments.soak.conftest import Make
from tests.verdicts.printed import ROOT, printed

PAGE = ROOT / "docs" / "verdicts.md"


@dataclass(frozen=True, slots=True)
class Row:
    """One line of the page's table."""

    command: str
    verdict: str
    planted: str
    test: str


def rows(text: str) -> list[Row]:
    """Of the table, without its head."""
    lines = [line for line in text.splitlines() if line.startswith("| `")]
    return [Row(*(cell.strip().strip("`") for cell in line.strip("| ").split(" | "))) for line in lines]


@cache
def names_in(file: Path) -> frozenset[str]:
    """Names of the test functions of a file; none where there is no such file."""
    if not file.is_file():
        return frozenset()
    found = ast.walk(ast.parse(file.read_text("utf-8")))
    return frozenset(n.name for n in found if isinstance(n, ast.FunctionDef) and n.name.startswith("test_"))


def amiss(table: list[Row], verdicts: set[tuple[str, str]]) -> list[str]:
    """What is wrong with the page, in words."""
    listed = {(row.command, row.verdict) for row in table}
    nowhere = [row.test for row in table if row.test.partition("::")[2] not in _tests(row)]
    return [
        *(f"{command}: {verdict}: no row" for command, verdict in sorted(verdicts - listed)),
        *(f"{command}: {verdict}: not printed" for command, verdict in sorted(listed - verdicts)),
        *(f"{test}: no such test" for test in nowhere),
        *(f"{row.verdict}: nothing planted" for row in table if not row.planted),
    ]


def _tests(row: Row) -> frozenset[str]:
    return names_in(ROOT / row.test.partition("::")[0])


def test_every_verdict_has_a_row_and_every_row_a_test(make: Make) -> None:
    assert amiss(rows(PAGE.read_text("utf-8")), printed(make)) == []


@pytest.mark.parametrize("command", [
    "demo", "bench", "soak", "trial", "faults", "accuracy", "record", "contact", "collisions"
])  # fmt: skip
def test_a_page_that_lacks_a_row_or_names_no_test_fails(make: Make, command: str) -> None:
    table, verdicts = rows(PAGE.read_text("utf-8")), printed(make)
    mine = next(row for row in table if row.command == command)
    rest = [row for row in table if row != mine]
    assert amiss(rest, verdicts) == [f"{command}: {mine.verdict}: no row"]
    gone = Row(command, mine.verdict, mine.planted, f"{mine.test}_gone")
    assert amiss([*rest, gone], verdicts) == [f"{gone.test}: no such test"]
    extra = Row(command, "never printed", "x", mine.test)
    assert amiss([*table, extra], verdicts) == [f"{command}: never printed: not printed"]
