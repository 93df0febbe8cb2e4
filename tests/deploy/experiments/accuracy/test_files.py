"""`tandem accuracy FILE...`: the measure, the reading of files, and the command from end to end."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from typer.testing import CliRunner

from common.errors import TandemError
from common.quaternion import Array, conjugate, from_rotation_vector, heading_turn, multiply, rotate
from deploy import cli
from deploy.experiments.accuracy.broad import errors, score, with_heading_of
from deploy.experiments.accuracy.online import run_online
from deploy.experiments.accuracy.recording import load_trial
from master.orientation.filters import FILTERS

RATE_HZ = 100.0
TICKS = 400


def trial(**changes: Any) -> dict[str, Any]:
    """Perfect readings of a turning unit, with its truth; None leaves an array out."""
    rng = np.random.default_rng(0)
    q = np.empty((TICKS, 4))
    now, gyr = Rotation.random(rng=rng).as_quat(scalar_first=True), np.empty((TICKS, 3))
    for tick in range(TICKS):
        gyr[tick] = 0.0 if tick == 0 else np.sin(np.array([1.0, 2.0, 3.0]) * tick / RATE_HZ)
        now = multiply(now, from_rotation_vector(gyr[tick] / RATE_HZ))
        q[tick] = now
    arrays = {
        "gyr": gyr,
        "acc": rotate(conjugate(q), np.tile([0.0, 0.0, 9.81], (TICKS, 1))),
        "mag": rotate(conjugate(q), np.tile([0.0, 20.0, -43.0], (TICKS, 1))),
        "rate_hz": RATE_HZ,
        "quat": q,
        "movement": np.arange(TICKS) >= 50,
    }
    arrays.update(changes)
    return {key: value for key, value in arrays.items() if value is not None}


def saved(folder: Path, name: str = "trial.npz", **changes: Any) -> Path:
    path = folder / name
    np.savez(path, **trial(**changes))
    return path


def holed(array: Array, rows: slice) -> Array:
    out = array.copy()
    out[rows] = np.nan
    return out


@settings(max_examples=50, derandomize=True, deadline=None)
@given(heading=st.floats(-3.1, 3.1), tilt=st.floats(0.0, 3.1), about=st.floats(0.0, 6.2))
def test_the_measure_splits_an_error_into_heading_and_inclination(
    heading: float, tilt: float, about: float
) -> None:
    truth = Rotation.random(rng=1).as_quat(scalar_first=True)[None]
    leaning = from_rotation_vector(tilt * np.array([[np.cos(about), np.sin(about), 0.0]]))
    found = errors(multiply(multiply(heading_turn([heading]), leaning), truth), truth)
    whole = Rotation.from_rotvec([0, 0, heading]) * Rotation.from_quat(leaning[0], scalar_first=True)
    assert found.total[0] == pytest.approx(whole.magnitude(), abs=1e-9)
    assert found.heading[0] == pytest.approx(abs(heading), abs=1e-6)
    assert found.inclination[0] == pytest.approx(tilt, abs=1e-6)


def test_the_score_counts_the_movement_where_there_is_truth() -> None:
    truth = np.tile([1.0, 0.0, 0.0, 0.0], (6, 1))
    truth[4] = np.nan
    q = heading_turn(np.radians([50.0, 3.0, 4.0, 5.0, 60.0, 70.0]))
    found = score(errors(q, truth), np.array([False, True, True, True, True, False]))
    assert found.total_deg == pytest.approx(np.sqrt((9 + 16 + 25) / 3))
    assert found.heading_deg == pytest.approx(found.total_deg)
    assert found.inclination_deg == pytest.approx(0.0, abs=1e-9)


def test_a_free_heading_is_set_where_the_movement_begins() -> None:
    truth = Rotation.random(5, rng=2).as_quat(scalar_first=True)
    found = with_heading_of(truth, multiply(heading_turn(1.3), truth), np.array([False, True] * 2 + [True]))
    assert np.max(errors(found, truth).total) < 1e-7


@pytest.mark.parametrize("name", list(FILTERS))
def test_a_perfect_recording_scores_near_zero_with_dropped_samples_too(name: str, tmp_path: Path) -> None:
    gaps = slice(200, 220)
    whole = load_trial(saved(tmp_path))
    # the gyro is not heard either, and the turn over the gap is then the next reading's: keep it slow
    holes = load_trial(saved(tmp_path, acc=holed(trial()["acc"], gaps)))
    assert int(holes.dropped.sum()) == 20
    for each, most_deg in ((whole, 2.0), (holes, 8.0)):
        run = run_online(each, FILTERS[name]().make(RATE_HZ, 1), lambda _: None)
        assert each.q_world_from_sensor is not None
        total_deg = score(errors(run.q_world_from_sensor, each.q_world_from_sensor), each.movement).total_deg
        assert total_deg is not None
        assert total_deg < most_deg
    assert run.us_per_sample["count"] == TICKS - 20
    assert np.array_equal(run.q_world_from_sensor[gaps], np.tile(run.q_world_from_sensor[199], (20, 1)))


def test_nothing_is_known_before_the_first_sample_kept(tmp_path: Path) -> None:
    late = load_trial(saved(tmp_path, gyr=holed(trial()["gyr"], slice(0, 3))))
    q = run_online(late, FILTERS["vqf"]().make(RATE_HZ, 1), lambda _: None).q_world_from_sensor
    assert np.isnan(q[:3]).all()
    assert np.isfinite(q[3:]).all()


def test_every_sample_counts_towards_the_progress(tmp_path: Path) -> None:
    heard: list[int] = []
    run_online(load_trial(saved(tmp_path)), FILTERS["vqf"]().make(RATE_HZ, 1), heard.append)
    assert sum(heard) == TICKS


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"gyr": None}, "has no gyr"),
        ({"acc": None, "rate_hz": None}, "no acc and no rate_hz"),
        ({"gyr": np.zeros((TICKS, 4))}, r"gyr has the shape \(400, 4\), not \(T, 3\)"),
        ({"acc": np.zeros((7, 3))}, r"acc has the shape \(7, 3\), not \(400, 3\)"),
        ({"mag": np.zeros(3)}, "mag has the shape"),
        ({"quat": np.zeros((TICKS, 3))}, "quat has the shape"),
        ({"quat": np.full((TICKS, 4), 1.0)}, "quat is not of unit length"),
        ({"quat": np.full((TICKS, 4), np.nan)}, "quat is unknown over the whole movement"),
        ({"movement": np.ones(3)}, "movement has the shape"),
        ({"movement": np.zeros(TICKS)}, "movement is false all along"),
        ({"movement": np.zeros(TICKS), "quat": None}, "movement is false all along"),
        ({"movement": np.full(TICKS, "yes")}, "not true and false"),
        ({"rate_hz": 0.0}, "rate_hz is 0.0, not one number of 10 to 10000"),
        ({"rate_hz": np.nan}, "rate_hz is nan"),
        ({"rate_hz": np.ones(2)}, "rate_hz is"),
        ({"gyr": np.full((TICKS, 3), "a")}, "not numbers"),
        ({"gyr": np.full((TICKS, 3), np.inf)}, "infinite"),
        ({"gyr": np.full((TICKS, 3), np.nan)}, "more than half"),
        ({"gyr": np.full((TICKS, 3), 200.0)}, "rad/s"),
        ({"acc": trial()["acc"] / 9.81}, "m/s²"),
        ({"gyr": np.zeros((3, 3)), "acc": np.ones((3, 3))}, "has 3 samples: record at least 10"),
        ({"acc": np.array([[None] * 3] * TICKS, dtype=object)}, "not an npz file of plain arrays"),
    ],
)
def test_a_malformed_file_is_refused_with_what_to_change(
    changes: dict[str, Any], says: str, tmp_path: Path
) -> None:
    path = saved(tmp_path, **changes)
    with pytest.raises(TandemError, match=says) as refused:
        load_trial(path)
    assert str(refused.value).startswith(f"{path}: ")


def test_what_is_no_npz_is_refused(tmp_path: Path) -> None:
    with pytest.raises(TandemError, match="no such file"):
        load_trial(tmp_path / "none.npz")
    text, one = tmp_path / "text.npz", tmp_path / "one.npy"
    text.write_text("gyr")
    np.save(one, np.zeros((20, 3)))
    for path in (text, one, tmp_path):
        with pytest.raises(TandemError, match="npz"):
            load_trial(path)
    cut = saved(tmp_path)
    cut.write_bytes(cut.read_bytes()[:2000])
    with pytest.raises(TandemError, match="not an npz file"):
        load_trial(cut)


def run_command(*arguments: str) -> str:
    result = CliRunner().invoke(cli.app, ["accuracy", *arguments], env={"COLUMNS": "200", "NO_COLOR": "1"})
    assert result.exit_code == 0, result.output
    return re.sub(r"[\s│]+", " ", result.output)


def test_the_command_tells_writes_and_draws(tmp_path: Path) -> None:
    path, report = saved(tmp_path), tmp_path / "scores.json"
    bare = saved(tmp_path, "bare.npz", quat=None, mag=None, movement=None)
    said = run_command(str(path), str(bare), "--filter", "all", "--report", str(report))
    assert "bare: no truth in it" in said
    assert "bare: no magnetometer" in said
    tree = json.loads(report.read_text("utf-8"))
    found = tree["files"][str(path)]["filters"]
    assert set(found) == {"vqf", "mahony", "ekf"}
    assert all(0.0 <= figures["total_deg"] < 2.0 for figures in found.values())
    assert tree["mean"]["ekf"]["total_deg"] == pytest.approx(found["ekf"]["total_deg"])
    assert tree["files"][str(bare)]["filters"]["ekf"]["from_vqf"]["inclination_deg"] < 1.0
    assert (tmp_path / "scores.png").read_bytes().startswith(b"\x89PNG")


def test_processes_change_no_figure(tmp_path: Path) -> None:
    path = saved(tmp_path)
    trees = []
    for jobs in ("1", "2"):
        report = tmp_path / f"{jobs}.json"
        run_command(str(path), str(path), "--jobs", jobs, "--report", str(report))
        trees.append(json.loads(report.read_text("utf-8")))
        for figures in trees[-1]["files"][str(path)]["filters"].values():
            assert figures.pop("us_per_sample")["count"] == TICKS
    assert trees[0] == trees[1]


def test_the_beginning_holds_so_many_samples(tmp_path: Path) -> None:
    late = load_trial(saved(tmp_path, gyr=holed(trial()["gyr"], slice(0, 30))))
    assert np.array_equal(late.beginning(10).gyr_rad_s, late.gyr_rad_s[30:40])
    assert len(late.beginning(10_000).movement) == TICKS - 30


def test_one_filter_alone_and_a_picture_by_its_own_name(tmp_path: Path) -> None:
    picture = tmp_path / "errors.png"
    said = run_command("--filter", "mahony", str(saved(tmp_path)), "--plot", str(picture))
    assert "mahony" in said
    assert "vqf" not in said
    assert picture.exists()
    bare = saved(tmp_path, "bare.npz", quat=None)
    picture.unlink()
    assert "–" in run_command(str(bare), "--filter", "ekf", "--plot", str(picture))
    assert not picture.exists()


def test_a_filter_that_there_is_not_and_a_folder_that_there_is_not(tmp_path: Path) -> None:
    path = str(saved(tmp_path))
    for arguments, says in (
        (["--filter", "magic"], "expected vqf, mahony, ekf or all"),
        (["--report", str(tmp_path / "none" / "r.json")], "there is no folder"),
    ):
        result = CliRunner().invoke(cli.app, ["accuracy", path, *arguments], env={"COLUMNS": "300"})
        assert result.exit_code == 2
        assert says in re.sub(r"[\s│]+", " ", result.output)


def test_the_group_s_commands_and_helps_stay_reachable() -> None:
    assert "tandem accuracy FILE..." in run_command("--help")
    assert "Example: tandem accuracy recording.npz" in run_command("files", "--help")
    for command in ("hinge", "papers"):
        assert "Example" in run_command(command, "--help")
