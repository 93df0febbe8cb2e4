"""CI fails where more tests skip than the repository allows, by reason; elsewhere nothing depends on it."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from .skips import TOO_MANY_SKIPPED, Allowed, counted, read_allowed, too_many

TESTS = Path(__file__).parent
RULES = (
    Allowed(r"host stalled in \d tries", 2, "it did"),
    Allowed("no recordings", 9, "they are elsewhere", without="DATA"),
    Allowed("no SocketCAN", 9, "run elsewhere", with_="RUNNER"),
)
STILL = ["the host stalled in 4 tries; last: a", "the host stalled in 4 tries; last: b"]


@pytest.mark.parametrize(
    ("reasons", "environment", "wrong"),
    [
        ([], {}, []),
        (STILL, {}, []),
        ([*STILL, STILL[0]], {}, ["3 skipped, at most 2 may: host stalled in \\d tries"]),
        (["nobody knows"], {}, ["1 skipped for a reason that is not listed: nobody knows"]),
        (["no recordings"] * 9, {}, []),
        (["no recordings"] * 10, {}, ["10 skipped, at most 9 may: no recordings"]),
        (["no recordings"], {"DATA": "/d"}, ["1 skipped, at most 0 may while DATA is set: no recordings"]),
        (["no SocketCAN"] * 9, {"RUNNER": "vm"}, []),
        (["no SocketCAN"], {}, ["1 skipped, at most 0 may unless RUNNER is set: no SocketCAN"]),
        (["no SocketCAN"], {"RUNNER": ""}, ["1 skipped, at most 0 may unless RUNNER is set: no SocketCAN"]),
    ],
)
def test_what_may_skip_and_what_may_not(
    reasons: list[str], environment: dict[str, str], wrong: list[str]
) -> None:
    assert too_many(reasons, RULES, environment) == wrong


def test_reasons_are_counted() -> None:
    assert counted(["b", "a", "b"]) == ["2 skipped: b", "1 skipped: a"]


def test_each_allowed_reason_says_what_shows_it_instead() -> None:
    allowed = read_allowed(TESTS / "skips.toml")
    assert all(each.why and each.at_most > 0 for each in allowed)
    data = ["TANDEM_DATA does not name the folder of recordings"]
    assert too_many(data, allowed, {}) == []
    assert too_many(data, allowed, {"TANDEM_DATA": "/data"}) != []


def run(folder: Path, reason: str, *arguments: str, ci: bool) -> tuple[int, str]:
    """A suite of one test that skips, with this suite's conftest; its status and what it printed."""
    (folder / "pytest.ini").write_text("[pytest]\ntestpaths = .\n")
    (folder / "test_one.py").write_text(f"import pytest\n\ndef test_one():\n    pytest.skip({reason!r})\n")
    environment = {key: value for key, value in os.environ.items() if key != "CI"}
    environment |= {"PYTHONPATH": str(TESTS.parent)} | ({"CI": "true"} if ci else {})
    command = [sys.executable, "-m", "pytest", "-q", "-p", "tests.conftest", "-p", "no:cacheprovider"]
    ended = subprocess.run(
        [*command, *arguments],
        cwd=folder, env=environment, capture_output=True, text=True, timeout=60, check=False,
    )  # fmt: skip
    return ended.returncode, ended.stdout + ended.stderr


@pytest.mark.parametrize("workers", [[], ["-n", "2"]], ids=["one process", "two workers"])
def test_ci_fails_for_a_reason_that_is_not_listed(tmp_path: Path, workers: list[str]) -> None:
    status, said = run(tmp_path, "somebody was lazy", *workers, ci=True)
    assert status == TOO_MANY_SKIPPED, said
    assert "1 skipped for a reason that is not listed: somebody was lazy" in said
    assert "tests/skips.toml" in said


def test_it_also_fails_for_skips_beside_a_test_that_failed(tmp_path: Path) -> None:
    (tmp_path / "test_two.py").write_text("def test_two():\n    raise AssertionError\n")
    assert run(tmp_path, "somebody was lazy", ci=True)[0] == TOO_MANY_SKIPPED


def test_a_part_of_the_suite_or_a_listed_reason_passes(tmp_path: Path) -> None:
    status, said = run(tmp_path, "somebody was lazy", ci=False)
    assert status == 0, said
    assert "1 skipped: somebody was lazy" in said
    for part in (["test_one.py"], ["-k", "one"], ["-m", "net or not net"]):
        assert run(tmp_path, "somebody was lazy", *part, ci=True)[0] == 0
    assert run(tmp_path, "root may use every device", ci=True)[0] == 0
