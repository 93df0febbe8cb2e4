"""The digest that keeps two versions of the code apart in one file of progress."""

from __future__ import annotations

from pathlib import Path

import pytest

from deploy.harness import code_state as module
from deploy.harness.code_state import PACKAGES, code_state


def folder(root: Path, name: str = "slave") -> Path:
    made = root / name
    (made / "limit").mkdir(parents=True)
    (made / "limit" / "damper.py").write_text("MARGIN_M = 0.02\n")
    (made / "slave.toml").write_text("speed = 1\n")
    return made


def test_the_same_code_is_the_same_wherever_it_lies(tmp_path: Path) -> None:
    one, other = folder(tmp_path / "a"), folder(tmp_path / "b")
    (other / "README.md").write_text("no code")
    assert code_state([one]) == code_state([other])
    assert len(code_state([one])) == 16


@pytest.mark.parametrize("file", ["limit/damper.py", "slave.toml"])
def test_a_changed_file_is_other_code(tmp_path: Path, file: str) -> None:
    made = folder(tmp_path)
    before = code_state([made])
    (made / file).write_text("MARGIN_M = 0.01\n")
    assert code_state([made]) != before


def test_a_file_of_another_name_is_other_code(tmp_path: Path) -> None:
    made = folder(tmp_path)
    before = code_state([made])
    (made / "limit" / "damper.py").rename(made / "damper.py")
    assert code_state([made]) != before


def test_what_it_computes_with_counts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    before = code_state([folder(tmp_path)])
    monkeypatch.setattr(module, "installed", lambda package: "0.0")
    assert code_state([tmp_path / "slave"]) != before


def test_all_four_packages_are_looked_at() -> None:
    assert [each.name for each in PACKAGES] == ["common", "master", "slave", "deploy"]
    assert all(any(each.rglob("*.py")) for each in PACKAGES)
