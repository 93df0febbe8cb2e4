"""`tandem calibrate imu` and `mag`: what a person types, and the files that come of it."""

import json
import shlex
from collections.abc import Callable
from datetime import date
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from common.config.load import load_config
from common.config.sensor_calibration import NodeCalibration
from common.errors import TandemError
from common.quaternion import Array, conjugate, from_rotation_vector, multiply, rotate, to_matrix
from deploy import cli
from tests.master.calibrate.test_six_position import session as six_faces

RATE_HZ = 50.0
BIAS: Array = np.array([0.3, -0.2, 0.1])


def session(turns: int = 16) -> dict[str, Array]:
    """Rests of 2.4 s with even turns of 1 s between them, and noise; orientations as `q`."""
    rng = np.random.default_rng(4)
    q, rows, rates = np.array([1.0, 0.0, 0.0, 0.0]), [], []
    for _ in range(turns):
        turn = rng.normal(size=3)
        for angle, rate in ((np.zeros(120), np.zeros(3)), (np.arange(50) / 50, turn)):
            rows.append(multiply(q, from_rotation_vector(angle[:, None] * turn)))
            rates.append(np.tile(rate, (len(angle), 1)))
        q = multiply(q, from_rotation_vector(turn))
    acc = rotate(conjugate(np.concatenate(rows)), np.array([0.0, 0.0, 9.80665])) - BIAS
    noise = rng.normal(scale=2e-3, size=(2, len(acc), 3))
    gyr = np.concatenate(rates) - 0.1 * BIAS + noise[1]
    return {"acc": acc + 10 * noise[0], "gyr": gyr, "q": np.concatenate(rows)}


def sphere() -> Array:
    v = np.random.default_rng(0).normal(size=(6000, 3))
    out: Array = 48.0 * v / np.linalg.norm(v, axis=1, keepdims=True) + 20.0 * BIAS
    return out


def run(line: str) -> str:
    """What it prints; errors pass."""
    result = CliRunner().invoke(cli.app, shlex.split(line), catch_exceptions=False)
    assert result.exit_code == 0, result.output
    return result.output


@pytest.fixture(scope="module")
def suit(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One sound node, and one whose gyro is broken."""
    path = tmp_path_factory.mktemp("suit") / "session.npz"
    s = session()
    time = np.arange(len(s["acc"])) / RATE_HZ
    np.savez(path, t_s=time, head_acc=s["acc"], head_gyr=s["gyr"], hip_acc=s["acc"], hip_gyr=0 * s["gyr"])
    return path


def test_imu_writes_file_picture_table_and_report(suit: Path, tmp_path: Path) -> None:
    said = run(f"calibrate imu {suit} --node head --out {tmp_path}/new/out --report {tmp_path}/r.json")
    assert "head" in said
    assert "15 moves" in said
    node = load_config(tmp_path / "new" / "out" / "head.toml", NodeCalibration)
    assert np.allclose(np.array(node.accelerometer)[:, 3], BIAS, atol=0.02)
    assert node.made.accelerometer is not None
    assert node.made.gyroscope is not None
    assert node.made.accelerometer.recording == "session.npz"
    assert node.made.accelerometer.date == date.today()
    assert (tmp_path / "new" / "out" / "head_imu.png").read_bytes().startswith(b"\x89PNG")
    figures = json.loads((tmp_path / "r.json").read_text())
    assert figures["nodes"]["head"]["still_intervals"] == 16
    assert figures["nodes"]["head"]["accelerometer"]["residual_after"] < 0.01
    assert figures["refused"] == {}


def test_a_refused_node_does_not_cost_the_others(suit: Path, tmp_path: Path) -> None:
    with pytest.raises(TandemError, match=r"session\.npz: hip: the gyroscope reads the same all along"):
        run(f"calibrate imu {suit} --out {tmp_path}")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["head.toml", "head_imu.png"]


def test_mag_adds_to_the_file_that_is_there(suit: Path, tmp_path: Path) -> None:
    mag = sphere()
    np.savez(tmp_path / "head.npz", acc=0 * mag, gyr=0 * mag, mag=mag, rate_hz=50.0)
    (tmp_path / "head.toml").write_text("# worn on the left\nq_sensor_from_segment = [0.6, 0.8, 0.0, 0.0]\n")
    figures = json.loads(run(f"calibrate mag {tmp_path}/head.npz --out {tmp_path} --json"))
    assert figures["nodes"]["head"]["field_ut"] == pytest.approx(48.0)
    assert figures["nodes"]["head"]["coverage"] > 0.9
    node = load_config(tmp_path / "head.toml", NodeCalibration)
    assert np.allclose(np.array(node.magnetometer)[:, 3], -20.0 * BIAS, atol=1e-6)
    assert node.q_sensor_from_segment == [0.6, 0.8, 0.0, 0.0]
    assert "# worn on the left" in (tmp_path / "head.toml").read_text()
    assert (tmp_path / "head_mag.png").read_bytes().startswith(b"\x89PNG")


Line = Callable[[Path], str]


@pytest.mark.parametrize(
    ("line", "message"),
    [
        (lambda suit: f"calibrate imu {suit} --node tail", r"has no node tail; it has head, hip"),
        (lambda suit: f"calibrate imu {suit}.npz", "no such file"),
        (lambda suit: f"calibrate mag {suit} --node head", "no magnetometer"),
        (lambda suit: f"calibrate mag {suit}", "head, hip: there are no magnetometer readings"),
        (lambda suit: f"calibrate mag {suit} --out {suit}", "cannot be made"),
    ],
)
def test_mistakes_are_one_clear_line(
    suit: Path, line: Line, message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(TandemError, match=message) as refused:
        run(line(suit))
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("command", ["imu", "mag"])
def test_help_has_an_example(command: str) -> None:
    assert f"Example: tandem calibrate {command} " in run(f"calibrate {command} --help").replace("`", "")


@pytest.fixture(scope="module")
def whole_session(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Rests in sixteen attitudes, the magnetometer's axes 2° off the accelerometer's."""
    path = tmp_path_factory.mktemp("whole") / "unit.npz"
    s = session(turns=40)
    apart = from_rotation_vector(np.radians([0.0, 2.0, 0.0]))
    mag = rotate(conjugate(apart), rotate(conjugate(s.pop("q")), np.array([0.0, 25.0, -43.3])))
    mag += np.random.default_rng(5).normal(scale=0.1, size=mag.shape)
    np.savez(path, rate_hz=RATE_HZ, mag=mag + BIAS, **s)  # type: ignore[arg-type]
    return path


def test_the_magnetometers_axes_are_turned_into_the_accelerometers(
    whole_session: Path, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    alone = json.loads(run(f"calibrate mag {whole_session} --out {out} --json"))["nodes"]["unit"]
    assert alone["aligned_deg"] is None
    assert "calibrate imu first" in " ".join(alone["notes"])
    run(f"calibrate imu {whole_session} --out {out}")
    found = json.loads(run(f"calibrate mag {whole_session} --out {out} --json"))["nodes"]["unit"]
    assert found["aligned_deg"] == pytest.approx(2.0, abs=0.1)
    map_ = np.array(load_config(out / "unit.toml", NodeCalibration).magnetometer)[:, :3]
    turn = map_ @ np.linalg.inv(np.array(alone["magnetometer"]["value"])[:, :3])
    np.testing.assert_allclose(turn, to_matrix(from_rotation_vector(np.radians([0.0, 2.0, 0.0]))), atol=2e-3)


def test_six_faces_and_three_turns_are_a_method_of_their_own(tmp_path: Path) -> None:
    acc, gyr = six_faces()
    noise = np.random.default_rng(0).normal(scale=2e-3, size=(2, len(acc), 3))
    np.savez(tmp_path / "unit.npz", acc=acc - BIAS + 10 * noise[0], gyr=gyr + noise[1], rate_hz=100.0)
    line = f"calibrate imu {tmp_path}/unit.npz --method six-position --out {tmp_path}"
    said = run(f"{line} --report {tmp_path}/r.json")
    assert "3 turns" in said
    node = load_config(tmp_path / "unit.toml", NodeCalibration)
    assert np.allclose(np.array(node.accelerometer)[:, 3], BIAS, atol=0.05)
    figures = json.loads((tmp_path / "r.json").read_text())["nodes"]["unit"]
    assert figures["method"] == "six-position"
    assert {one["verdict"] for one in figures["evidence"]} == {"agrees"}


@pytest.mark.parametrize("name", ["mirrored", "swapped"])
def test_a_magnetometer_that_contradicts_the_gyroscope_is_not_written(
    name: str, whole_session: Path, tmp_path: Path
) -> None:
    arrays = dict(np.load(whole_session))
    mag = arrays["mag"]
    arrays["mag"] = mag * [-1.0, 1.0, 1.0] if name == "mirrored" else mag[:, [1, 0, 2]] * [1.0, 1.0, -1.0]
    np.savez(tmp_path / "unit.npz", **arrays)
    with pytest.raises(TandemError, match=r"a mirror image|accept it with --axes=y,x,-z;"):
        run(f"calibrate mag {tmp_path}/unit.npz --out {tmp_path}/out")
    assert list((tmp_path / "out").glob("*.toml")) == []
    if name == "swapped":
        run(f"calibrate mag {tmp_path}/unit.npz --out {tmp_path}/out --axes=y,x,-z")
        assert (tmp_path / "out" / "unit.toml").exists()
