import json
import os
from pathlib import Path

import numpy as np
import pytest
import typer

from common.calibration import NodeCalibration
from common.config import load_config
from common.errors import TandemError
from deploy.calibrate.mount import _times, mount


@pytest.mark.parametrize("text", ["3", "1:2:3", "a:b", "-1:2", ":", "²:3", "5:2", "2:2", "1e3:2e3"])
def test_a_stance_that_is_no_from_to_is_refused(text: str) -> None:
    with pytest.raises(typer.BadParameter, match="FROM:TO"):
        _times(text)


def test_a_recording_of_somebody_else_s_segments_is_refused(tmp_path: Path) -> None:
    up = np.tile([0.0, 0.0, 9.81], (500, 1))
    np.savez(tmp_path / "s.npz", t_s=0.01 * np.arange(500), tail_acc=up, tail_gyr=np.zeros((500, 3)))
    with pytest.raises(TandemError, match=r"no node of the recording \(tail …\) is a segment of the profile"):
        mount(tmp_path / "s.npz", out=tmp_path / "out")


def test_nodes_that_stood_still_are_refused_by_name_and_not_written(tmp_path: Path) -> None:
    noise = 0.001 * np.random.default_rng(0).normal(size=(500, 3))
    up = np.tile([0.0, 0.0, 9.81], (500, 1))
    arrays = {f"{n}_{k}": v for n in ("chest", "head") for k, v in (("acc", up), ("gyr", noise))}
    np.savez(tmp_path / "s.npz", t_s=0.01 * np.arange(500), **arrays)
    with pytest.raises(TandemError, match=r"head is not written: .*hardly moved; walk some steps"):
        mount(tmp_path / "s.npz", out=tmp_path / "out")
    assert list((tmp_path / "out").glob("*.toml")) == []


@pytest.mark.recordings
def test_a_real_person_s_suit(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = os.environ.get("TANDEM_DATA")
    if not folder:
        pytest.skip("TANDEM_DATA does not name the folder of recordings")
    mount(Path(folder) / "human_full_body.npz", out=tmp_path, report=tmp_path / "report.json")
    report = json.loads((tmp_path / "report.json").read_text("utf-8"))
    assert len(report["nodes"]) == 8
    for name, node in report["nodes"].items():
        said = load_config(tmp_path / f"{name}.toml", NodeCalibration).q_sensor_from_segment
        np.testing.assert_allclose(said, node["q_sensor_from_segment"], atol=1e-9)
    assert (tmp_path / "mounting.png").stat().st_size > 20_000
    assert "two axes" in capsys.readouterr().out
