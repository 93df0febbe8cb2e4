"""`tandem import`: what is written is what was read, units and axes are checked, others take it."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from common.errors import TandemError
from common.quaternion import Array
from common.skeleton import load_skeleton
from deploy.cli import app
from deploy.experiments.accuracy.recording import load_trial
from deploy.sim.suit.replay import load_replay
from master.calibrate.recording import load_recordings
from tests.common.recording.formats.made import G, Session, bag2, mvnx, session, table, ximu3

S = session(20.0)
TURNED = np.array([1.0, -1.0, -1.0])
"""Mounted half a turn about x."""
NAMES = "time_s,acc_x,acc_y,acc_z,gyr_x,gyr_y,gyr_z"


def run(*words: object) -> str:
    found = CliRunner().invoke(app, ["import", *map(str, words)])
    if found.exception is not None and not isinstance(found.exception, SystemExit):
        raise found.exception
    assert found.exit_code == 0, found.output
    return found.output


def csv(folder: Path, acc: Array = S.acc, gyr: Array = S.gyr, name: str = "left.csv") -> Path:
    return table(folder / name, NAMES, np.column_stack([S.time_s, acc, gyr]))


def test_one_unit_as_npz_is_scored(tmp_path: Path) -> None:
    folder = ximu3(tmp_path, S)
    out = tmp_path / "unit.npz"
    told = run(folder, "--out", out)
    assert "in g, converted to m/s^2" in told
    assert "gyroscope and accelerometer agree" in told
    trial = load_trial(out)
    np.testing.assert_allclose(trial.acc_m_s2, S.acc, rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(trial.gyr_rad_s, S.gyr, rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(trial.mag_ut, S.mag, rtol=1e-6, atol=1e-6)
    direct = load_trial(folder)
    np.testing.assert_array_equal(direct.acc_m_s2, trial.acc_m_s2)
    assert any("converted to m/s^2" in note for note in direct.notes)


def test_nodes_of_several_files_as_a_suit(tmp_path: Path) -> None:
    left, right = csv(tmp_path), csv(tmp_path, TURNED * S.acc, TURNED * S.gyr, "right.csv")
    out = tmp_path / "suit.mcap"
    run(
        left,
        right,
        "--to",
        "mcap",
        "--out",
        out,
        "--name",
        "left=left_forearm",
        "--name",
        "right=right_forearm",
    )
    nodes = load_recordings(out)
    assert list(nodes) == ["left_forearm", "right_forearm"]
    np.testing.assert_allclose(nodes["right_forearm"].acc_m_s2, TURNED * S.acc, rtol=1e-6, atol=1e-6)
    # a suit is played back, by the segments' names
    replay = load_replay(out, load_skeleton("nursing"), ["left_forearm"])
    index = load_skeleton("nursing").segment_names.index("left_forearm")
    np.testing.assert_allclose(replay.readings(1.0)[index, :3], S.acc[100], rtol=1e-6, atol=1e-6)
    many = tmp_path / "suit.npz"
    run(out, "--out", many)
    with np.load(many) as arrays:
        assert set(arrays) == {f"{n}_{q}" for n in nodes for q in ("acc", "gyr")} | {"t_s"}


def test_calibrate_takes_a_bag_and_mvnx_as_they_are(tmp_path: Path) -> None:
    (node,) = load_recordings(bag2(tmp_path, S)).values()
    assert node.name == "left_hand"
    (node,) = load_recordings(mvnx(tmp_path, S)).values()
    assert node.name == "forearm_right"
    np.testing.assert_allclose(node.gyr_rad_s, S.gyr, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize(
    ("acc", "gyr", "message"),
    [
        (S.acc / G, S.gyr, r"reads 1 at rest; expected about 9\.81 m/s\^2: these are g; give --units acc=g"),
        (S.acc, np.degrees(S.gyr), r"seems to read °/s, expected rad/s .*\(--units gyr=deg/s\)"),
        (S.acc, S.gyr[:, [1, 0, 2]], "left: its gyroscope contradicts gravity"),
        (S.acc * [1.0, 1.0, -1.0], S.gyr, "left: its gyroscope contradicts gravity"),
        (S.acc * 417.0, S.gyr, "another unit or raw counts"),
    ],
    ids=["g", "degrees", "exchanged axes", "left-handed", "counts"],
)
def test_units_and_axes_that_cannot_be_are_refused_in_a_line(
    tmp_path: Path, acc: Array, gyr: Array, message: str
) -> None:
    path, out = csv(tmp_path, acc, gyr), tmp_path / "out.npz"
    with pytest.raises(TandemError, match=message) as refused:
        run(path, "--out", out)
    assert len(str(refused.value).splitlines()) == 2, "the reason, and what to do all the same"
    assert not out.exists()
    run(path, "--out", out, "--force")
    assert out.exists()


@pytest.mark.parametrize(
    ("gyr", "message"),
    [
        (0.01 * S.gyr[:800], r"tells no unit of its gyroscope, .* give --units gyr=rad/s or gyr=deg/s"),
        (
            S.gyr[:800] * 200.0 / np.abs(S.gyr[:800]).max(),
            r"reads up to 200 .* at most 70 rad/s: give --units",
        ),
    ],
    ids=["either", "degrees by their size"],
)
def test_a_unit_that_neither_the_file_nor_the_motion_tells_is_asked_for(
    tmp_path: Path, gyr: Array, message: str
) -> None:
    """8 s are too short to hold the gyroscope's turns against gravity's."""
    out = tmp_path / "out.npz"
    rows = np.column_stack([S.time_s[:800], np.tile([0.0, 0.0, G], (800, 1)), gyr])
    path = table(tmp_path / "left.csv", NAMES, rows)
    with pytest.raises(TandemError, match=message):
        run(path, "--out", out)
    assert not out.exists()
    assert "not judged" in run(path, "--out", out, "--units", "gyr=deg/s")
    with np.load(out) as arrays:
        np.testing.assert_allclose(arrays["gyr"], np.radians(gyr), rtol=1e-6, atol=1e-6)
    named = table(tmp_path / "named.csv", NAMES.replace("gyr_x", "gyr_x_dps").replace("gyr_y", "gyr_y_dps")
                  .replace("gyr_z", "gyr_z_dps"), rows)  # fmt: skip
    assert "not judged" in run(named, "--out", tmp_path / "named.npz")


def test_g_and_degrees_when_told_so(tmp_path: Path) -> None:
    path, out = csv(tmp_path, S.acc / G, np.degrees(S.gyr)), tmp_path / "out.npz"
    tree = json.loads(run(path, "--out", out, "--units", "acc=g,gyr=deg/s", "--json"))
    assert tree["nodes"]["left"]["gravity_m_s2"] == pytest.approx(G)
    assert "agree" in tree["nodes"]["left"]["judged"]
    with np.load(out) as arrays:
        np.testing.assert_allclose(arrays["acc"], S.acc, rtol=1e-6, atol=1e-6)
        np.testing.assert_allclose(arrays["gyr"], S.gyr, rtol=1e-6, atol=1e-6)


def test_no_file_is_written_over_and_each_mistake_is_named(tmp_path: Path) -> None:
    path, out = csv(tmp_path), tmp_path / "out.npz"
    out.write_bytes(b"mine")
    with pytest.raises(TandemError, match=r"out\.npz: is there already"):
        run(path, "--out", out)
    assert out.read_bytes() == b"mine"
    for words, message in (
        (("--node", "right"), "--node right: is not there; there are left"),
        (("--name", "left"), "--name left: expected OLD=NEW"),
        (("--columns", "acc"), "--columns acc: expected a quantity and its columns"),
        (("--columns", "tmp=a,b,c"), "--columns tmp: expected one of acc, gyr"),
        (("--out", tmp_path / "a.csv"), r"expected a name that ends in \.npz"),
    ):
        with pytest.raises(TandemError, match=message):
            run(path, *words)


def test_a_gap_is_told_and_the_rest_is_judged(tmp_path: Path) -> None:
    holed = Session(
        *(np.delete(part, np.s_[300:400], axis=0) for part in (S.time_s, S.acc, S.gyr, S.mag, S.q))
    )
    path = table(tmp_path / "left.csv", NAMES, np.column_stack([holed.time_s, holed.acc, holed.gyr]))
    told = run(path, "--out", tmp_path / "out.npz")
    assert "100 samples are missing" in told
    assert "agree" in told


def test_a_file_of_several_nodes_is_not_scored_as_one(tmp_path: Path) -> None:
    out = tmp_path / "suit.mcap"
    run(csv(tmp_path), csv(tmp_path, name="right.csv"), "--to", "mcap", "--out", out)
    with pytest.raises(
        TandemError, match=r"holds the nodes left, right: take one \(tandem import suit\.mcap"
    ):
        load_trial(out)
