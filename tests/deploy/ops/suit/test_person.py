"""`tandem suit check --person` on a recording: status, words, JSON."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from deploy import cli
from deploy.examples.profiles import EXAMPLES
from tests.deploy.measure.person.led import led_person

MASTER = EXAMPLES / "master.toml"


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("person") / "worn.npz"
    arrays: dict[str, Any] = {}
    for name, node in led_person().items():
        arrays[f"{name}_acc"], arrays[f"{name}_gyr"] = node.acc_m_s2, node.gyr_rad_s
    np.savez(path, t_s=np.arange(12000) / 100.0, **arrays)
    return path


def checked(*options: object) -> tuple[int, str]:
    arguments = ["suit", "check", str(MASTER), "--person", *map(str, options)]
    result = CliRunner().invoke(cli.app, arguments)
    return result.exit_code, result.output + str(result.exception or "")


def test_a_good_recording_is_accepted_and_a_mirrored_one_refused(recording: Path, tmp_path: Path) -> None:
    status, said = checked("--recording", recording)
    assert (status, said.strip().endswith("accepted")) == (0, True), said
    with np.load(recording) as file:
        arrays: dict[str, Any] = dict(file)
    arrays["left_hand_gyr"] = arrays["left_hand_gyr"] * [1.0, -1.0, 1.0]
    np.savez(tmp_path / "bad.npz", **arrays)
    status, said = checked("--recording", tmp_path / "bad.npz", "--json")
    assert status == 1
    found = json.loads(said[: said.rindex("}") + 1])
    assert not found["accepted"]
    assert [(one["node"], one["what"]) for one in found["findings"]] == [("left_hand", "mirrored")]


def test_a_node_that_is_not_in_the_recording_is_not_accepted_unseen(recording: Path, tmp_path: Path) -> None:
    with np.load(recording) as file:
        arrays: dict[str, Any] = {name: kept for name, kept in file.items() if "left_hand" not in name}
    np.savez(tmp_path / "lacking.npz", **arrays)
    status, said = checked("--recording", tmp_path / "lacking.npz")
    assert status
    assert "not in the recording: left_hand" in " ".join(said.split())


def test_it_asks_for_a_file() -> None:
    status, said = checked()
    assert status
    assert "--out, or a recording by --recording" in said
