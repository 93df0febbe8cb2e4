import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import typer

from common.config.load import load_config
from common.config.sensor_calibration import NodeCalibration
from common.errors import TandemError
from deploy.calibrate.align import _times, align
from tests.master.calibrate.worn import wear


@pytest.mark.parametrize("text", ["3", "1:2:3", "a:b", "-1:2", ":", "²:3", "5:2", "2:2", "1e3:2e3"])
def test_a_zero_pose_that_is_no_from_to_is_refused(text: str) -> None:
    with pytest.raises(typer.BadParameter, match="FROM:TO"):
        _times(text)


def test_a_recording_of_somebody_else_s_segments_is_refused(tmp_path: Path) -> None:
    up = np.tile([0.0, 0.0, 9.81], (500, 1))
    np.savez(tmp_path / "s.npz", t_s=0.01 * np.arange(500), tail_acc=up, tail_gyr=np.zeros((500, 3)))
    with pytest.raises(TandemError, match=r"no node of the recording \(tail …\) is a segment of the profile"):
        align(tmp_path / "s.npz", out=tmp_path / "out")


def test_nodes_that_stood_still_are_refused_by_name_and_not_written(tmp_path: Path) -> None:
    noise = 0.001 * np.random.default_rng(0).normal(size=(500, 3))
    up = np.tile([0.0, 0.0, 9.81], (500, 1))
    arrays = {f"{n}_{k}": v for n in ("chest", "head") for k, v in (("acc", up), ("gyr", noise))}
    np.savez(tmp_path / "s.npz", t_s=0.01 * np.arange(500), **arrays)  # type: ignore[arg-type]
    with pytest.raises(TandemError, match=r"chest, head are not written: .*hardly moved; walk some steps"):
        align(tmp_path / "s.npz", out=tmp_path / "out")
    assert list((tmp_path / "out").glob("*.toml")) == []


def test_evidence_that_contradicts_itself_writes_nothing(tmp_path: Path) -> None:
    """Two nodes exchanged, and every gyroscope in °/s: exit with the cause, and no file."""
    nodes = wear("nursing", 7).nodes
    exchanged = nodes | {"left_forearm": nodes["right_hand"], "right_hand": nodes["left_forearm"]}
    in_degrees = {n: replace(unit, gyr_rad_s=np.degrees(unit.gyr_rad_s)) for n, unit in nodes.items()}
    cases = (
        (exchanged, "left_forearm and right_hand seem to be exchanged"),
        (in_degrees, "seems to read °/s"),
    )
    for number, (spoilt, said) in enumerate(cases):
        out = tmp_path / str(number)
        arrays = {f"{n}_acc": unit.acc_m_s2 for n, unit in spoilt.items()}
        arrays |= {f"{n}_gyr": unit.gyr_rad_s for n, unit in spoilt.items()}
        length = len(next(iter(arrays.values())))
        np.savez(tmp_path / "s.npz", t_s=0.01 * np.arange(length), **arrays)  # type: ignore[arg-type]
        with pytest.raises(TandemError, match=said) as error:
            align(tmp_path / "s.npz", out=out, report=tmp_path / "report.json")
        assert list(out.glob("*.toml")) == []
        assert number or len(str(error.value).splitlines()) == 1
        report = json.loads((tmp_path / "report.json").read_text("utf-8"))
        assert any(e["verdict"] == "contradicts" for e in report["evidence"]["left_forearm"])


@pytest.mark.long
def test_a_real_person_s_suit(tmp_path: Path, capsys: pytest.CaptureFixture[str], real_person: Path) -> None:
    align(real_person, out=tmp_path, report=tmp_path / "report.json")
    report = json.loads((tmp_path / "report.json").read_text("utf-8"))
    assert len(report["nodes"]) == 8
    for name, node in report["nodes"].items():
        said = load_config(tmp_path / f"{name}.toml", NodeCalibration).q_sensor_from_segment
        np.testing.assert_allclose(said, node["q_sensor_from_segment"], atol=1e-9)
    assert (tmp_path / "alignment.png").stat().st_size > 20_000
    assert "two axes" in capsys.readouterr().out
