import json
from pathlib import Path

import numpy as np
import pytest

from deploy.experiments.accuracy.hinge import hinge, load_pair
from master.calibrate.hinge import PoorMotionError
from master.calibrate.recording import RecordingError


def still(seconds: float = 10.0) -> dict[str, object]:
    samples = round(100.0 * seconds)
    noise = 0.001 * np.random.default_rng(0).normal(size=(2, samples, 3))
    up = np.tile([0.0, 0.0, 9.81], (samples, 1))
    return {"gyr1": noise[0], "gyr2": noise[1], "acc1": up, "acc2": up, "rate_hz": 100.0}


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"acc2": None}, "has no acc2; it has "),
        ({"rate_hz": np.ones(3)}, "rate_hz is .*expected one number"),
        ({"rate_hz": 1.0}, "expected 20 to 10000 Hz"),
        ({"gyr2": np.zeros((7, 3))}, r"gyr2 is float64 of shape \(7, 3\)"),
        ({"gyr1": np.full((1000, 3), "x")}, "gyr1 is <U1"),
        ({key: np.zeros((0, 3)) for key in ("gyr1", "gyr2", "acc1", "acc2")}, r"shape \(0, 3\)"),
    ],
)
def test_a_file_that_is_no_pair_is_refused(change: dict[str, object], said: str, tmp_path: Path) -> None:
    arrays = {k: v for k, v in {**still(), **change}.items() if v is not None}
    np.savez(tmp_path / "pair.npz", **arrays)  # type: ignore[arg-type]  # its stubs know no dict of mixed
    with pytest.raises(RecordingError, match=said):
        load_pair(tmp_path / "pair.npz")


def test_what_is_no_npz_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="no such file"):
        load_pair(tmp_path / "none.npz")
    (tmp_path / "text.npz").write_text("knee", "utf-8")
    with pytest.raises(RecordingError, match="not an npz file"):
        load_pair(tmp_path / "text.npz")


def test_a_joint_nobody_bent_is_refused_and_nothing_written(tmp_path: Path) -> None:
    np.savez(tmp_path / "pair.npz", **still())  # type: ignore[arg-type]
    with pytest.raises(PoorMotionError, match="hardly bent"):
        hinge(tmp_path / "pair.npz", report=tmp_path / "report.json")
    assert not (tmp_path / "report.json").exists()


def test_a_real_knee(tmp_path: Path, capsys: pytest.CaptureFixture[str], real_person: Path) -> None:
    with np.load(real_person) as person:
        names = {"1": "upper_leg_left", "2": "lower_leg_left"}
        arrays = {f"{key}{i}": person[f"{name}_{key}"] for i, name in names.items() for key in ("gyr", "acc")}
    np.savez(tmp_path / "knee.npz", rate_hz=100.0, **arrays)
    hinge(tmp_path / "knee.npz", report=tmp_path / "knee.json", picture=tmp_path / "knee.png")
    said = json.loads((tmp_path / "knee.json").read_text("utf-8"))
    assert said["angle_deg"]["lowest"] > -15.0
    assert 90.0 < said["angle_deg"]["highest"] < 150.0
    assert said["angle_deg"]["fastest_deg_s"] < 900.0
    assert (tmp_path / "knee.png").stat().st_size > 5000
    assert "conditioning" in capsys.readouterr().out
