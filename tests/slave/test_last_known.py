"""Where the joints stood is on disk, whole, or not known."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from slave.last_known import CHANGED_RAD, LastKnown, load, save, state_file


def test_what_is_kept_is_found_again(tmp_path: Path) -> None:
    file = tmp_path / "deep" / "robot-1.last-known.json"
    kept = LastKnown(file, ("a", "b"))
    assert kept.before_rad == {}
    assert kept.due(np.zeros(2))
    kept.keep(np.array([0.5, -1.0]))
    assert LastKnown(file, ("a", "b")).before_rad == {"a": 0.5, "b": -1.0}
    assert not kept.due(np.array([0.5, -1.0 + 0.99 * CHANGED_RAD]))
    assert kept.due(np.array([0.5, -1.0 + 1.01 * CHANGED_RAD]))
    assert [path.name for path in file.parent.iterdir()] == [file.name]


@pytest.mark.parametrize("text", ["", "{", "[]", '{"position_rad": 3}', '{"position_rad": {"a": "x"}}'])
def test_what_cannot_be_read_is_not_known(tmp_path: Path, text: str) -> None:
    file = tmp_path / "robot-1.last-known.json"
    file.write_text(text, "utf-8")
    assert load(file) == {}


def test_an_angle_that_is_no_number_is_not_known(tmp_path: Path) -> None:
    file = tmp_path / "x.json"
    save(file, {"a": float("nan"), "b": 1.0})
    assert load(file) == {"b": 1.0}


def test_a_write_that_is_cut_off_leaves_the_old_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "x.json"
    save(file, {"a": 1.0})

    def cut(_: object) -> None:
        raise OSError("no power")

    monkeypatch.setattr("slave.last_known.os.fsync", cut)
    LastKnown(file, ("a",)).keep(np.array([2.0]))
    assert load(file) == {"a": 1.0}


def test_where_it_is_kept() -> None:
    assert state_file("r", {"STATE_DIRECTORY": "/var/lib/tandem"}) == Path(
        "/var/lib/tandem/r.last-known.json"
    )
    assert state_file("r", {"XDG_STATE_HOME": "/s"}) == Path("/s/tandem/r.last-known.json")
    assert state_file("r", {"HOME": "/h"}) == Path("/h/.local/state/tandem/r.last-known.json")
