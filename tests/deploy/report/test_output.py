"""What cannot be written is one clear line."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import typer

from common.errors import TandemError
from deploy.report.output import in_a_folder, write_json, writing


def test_a_report_is_json_that_people_can_read(tmp_path: Path) -> None:
    write_json(tmp_path / "r.json", {"field_µT": 48.0})
    text = (tmp_path / "r.json").read_text("utf-8")
    assert json.loads(text) == {"field_µT": 48.0}
    assert "µ" in text
    assert text.endswith("}\n")


def test_what_cannot_be_written_is_said(tmp_path: Path) -> None:
    with pytest.raises(TandemError, match=r"r\.json: cannot be written \(No such file or directory\)"):
        write_json(tmp_path / "none" / "r.json", {})
    with pytest.raises(TandemError, match=r"cannot be written \(Is a directory\)"):
        write_json(tmp_path, {})
    with pytest.raises(TandemError, match=r"a\.png: cannot be written"), writing(Path("a.png")):
        raise OSError("encoder error -2 when writing image file")


def test_a_folder_that_is_not_there_is_told_before_the_work(tmp_path: Path) -> None:
    assert in_a_folder(None) is None
    assert in_a_folder(tmp_path / "r.json") == tmp_path / "r.json"
    with pytest.raises(typer.BadParameter, match="there is no folder"):
        in_a_folder(tmp_path / "none" / "r.json")
