"""From the first step to the nodes' files, with a simulated operator and raw units, on a virtual clock."""

from __future__ import annotations

import io
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rich.console import Console
from scipy.spatial.transform import Rotation

from common.config.load import load_config
from common.config.sensor_calibration import NodeCalibration
from common.errors import TandemError
from common.quaternion import Array, from_rotation_vector
from deploy.calibrate.live.command import parts
from deploy.calibrate.live.compute import Choice, compute, inherit
from deploy.calibrate.live.guide import GuideOptions, What
from deploy.calibrate.live.run import LiveSession, free_name
from deploy.calibrate.live.screen import line, screen
from deploy.examples.profiles import EXAMPLES
from deploy.sim.suit.config import SuitConfig
from deploy.sim.suit.imperfections import Imperfections
from deploy.sim.suit.suit import Wearer, _wearer
from master.config import MasterConfig
from master.suit.sweep import Sweep

SEED = 7
RATE_HZ = 50
SLOW = (
    f"capture.rate_hz={RATE_HZ}",
    *(f"estimation.{s}_cutoff_hz=0.0" for s in ("accelerometer", "gyroscope", "magnetometer")),
)
OPTIONS = GuideOptions(still_s=1.5, attitudes=20, tumble_s=5.0, zero_pose_s=3.0, move_joints_s=12.0)


@dataclass
class Done:
    config: MasterConfig
    session: LiveSession
    folder: Path
    figures: dict[str, Any]
    refusals: list[str]
    said: str
    units: Imperfections
    alignment: Array


def loaded(role: str, *overrides: str) -> Any:
    models: dict[str, Any] = {"master": MasterConfig, "suit": SuitConfig}
    return load_config(EXAMPLES / "lower_limb" / f"{role}.toml", models[role], overrides)


def askew(names: tuple[str, ...]) -> dict[str, list[float]]:
    random = np.random.default_rng(SEED)
    turns = random.uniform(-0.5, 0.5, (len(names), 3))
    return {name: from_rotation_vector(turn).tolist() for name, turn in zip(names, turns, strict=True)}


def sweeps(wearer: Wearer, tick: int, silent: tuple[int, ...] = ()) -> Sweep:
    """What the poll would give, with every hundredth tick of one node missing."""
    readings = wearer.at(tick / RATE_HZ).readings
    fresh = np.ones(len(readings), dtype=np.bool_)
    fresh[tick // 100 % len(readings)] = tick % 100 != 50
    fresh[list(silent)] = False
    stamp = tick * 20_000_000
    mag = readings[:, 6:]
    return Sweep(tick, stamp, stamp, readings[:, :3], readings[:, 3:6], mag, fresh, ~fresh)


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> Done:
    """A whole session, as fast as it goes."""
    folder = tmp_path_factory.mktemp("calibration")
    config: MasterConfig = loaded("master", *SLOW)
    names = config.skeleton.segment_names
    alignment = askew(names)
    suit: SuitConfig = loaded("suit").model_copy(
        update={"motion": "calibration", "grade": "raw", "seed": SEED, "alignment": alignment}
    )
    suit = suit.model_copy(
        update={"tray": suit.tray.model_copy(update={"attitudes": 22, "still_s": 2.3, "tumble_s": 20.0})}
    )
    wearer = _wearer(suit, config.skeleton)
    text = io.StringIO()
    console = Console(file=text, width=120)
    led = LiveSession(config, OPTIONS, folder, console)
    led.begin()
    for tick in range(400 * RATE_HZ):
        led.on_sweep(sweeps(wearer, tick))
        if tick % 20 == 0 and led.take().step == "done":
            break
    led.end()
    figures, refusals = compute(
        config, led.session, Choice(OPTIONS.what, 9.80665, OPTIONS.still_s, pictures=False), folder, console
    )
    units = Imperfections("raw", len(names), SEED)
    q = np.array([alignment[name] for name in names])
    return Done(config, led, folder, figures, refusals, text.getvalue(), units, q)


def file(done: Done, name: str) -> NodeCalibration:
    return load_config(done.folder / f"{name}.toml", NodeCalibration)


def calibrated(done: Done, i: int, sensor: int, truth: Array) -> tuple[Array, Array]:
    """What unit i reads for the truth (K, 3), and what its file makes of it."""
    raw = truth @ done.units._gain[i, sensor] + done.units._bias[i, 3 * sensor : 3 * sensor + 3]
    name = done.config.skeleton.segment_names[i]
    affine = np.array(getattr(file(done, name), ("accelerometer", "gyroscope", "magnetometer")[sensor]))
    return raw, raw @ affine[:, :3].T + affine[:, 3]


def worst(done: Done, sensor: int, strength: float) -> tuple[float, float]:
    """The largest error over all nodes and directions, raw and calibrated, of vectors of that length.

    The accelerometer's first axis decides what a unit's axes are, so all is compared in axes turned by what
    brings its calibrated readings nearest to the truth; the alignment takes up that turn.
    """
    truth = np.random.default_rng(5).standard_normal((200, 3))
    truth /= np.linalg.norm(truth, axis=1, keepdims=True)
    raw_error, error = 0.0, 0.0
    for i in range(len(done.config.skeleton.segments)):
        turn, _ = Rotation.align_vectors(truth, calibrated(done, i, 0, 9.80665 * truth)[1])
        raw, mapped = calibrated(done, i, sensor, strength * truth)
        if sensor == 2:  # its strength is relative
            mapped *= strength / np.linalg.norm(mapped, axis=1).mean()
        raw_error = max(raw_error, float(np.linalg.norm(raw - strength * truth, axis=1).max()))
        error = max(error, float(np.linalg.norm(turn.apply(mapped) - strength * truth, axis=1).max()))
    return raw_error, error


@pytest.mark.long
def test_it_comes_to_the_end_and_refuses_nothing(done: Done) -> None:
    assert done.session.session.finished
    # the simulated person cannot move the pelvis, so which way it faces cannot be told, and that is said
    assert [refusal.split(":")[1].strip() for refusal in done.refusals] == ["pelvis is not written"]
    recordings = done.session.session.counters["recordings"]
    assert isinstance(recordings, list)
    assert [r["file"] for r in recordings] == ["tray.mcap", "worn.mcap"]
    assert all(r["put"] == r["written"] and not r["failed"] for r in recordings)


@pytest.mark.long
@pytest.mark.parametrize(
    ("sensor", "strength", "left", "share"),
    [(0, 9.80665, 0.06, 0.1), (1, 2.0, 0.01, 0.05), (2, 50.0, 0.5, 0.05)],
    ids=["accelerometer m/s²", "gyroscope rad/s", "magnetometer µT"],
)
def test_calibrated_units_err_far_less_than_raw_ones(
    done: Done, sensor: int, strength: float, left: float, share: float
) -> None:
    before, after = worst(done, sensor, strength)
    assert after < left
    assert after < share * before


@pytest.mark.long
def test_the_alignment_is_found(done: Done) -> None:
    """Against how the simulated units really sit."""
    from common.quaternion import angle_between, conjugate

    for name, q_segment_from_sensor in zip(done.config.skeleton.segment_names, done.alignment, strict=True):
        if name == "pelvis":
            continue
        found = np.array(file(done, name).q_sensor_from_segment)
        error_deg = float(np.degrees(angle_between(found, conjugate(q_segment_from_sensor))))
        assert error_deg < 5.0, f"{name}: {error_deg:.1f}°"


@pytest.mark.long
def test_every_part_says_how_it_came_about(done: Done) -> None:
    for name in done.config.skeleton.segment_names:
        made = tomllib.loads((done.folder / f"{name}.toml").read_text("utf-8"))["made"]
        assert set(made) >= {"accelerometer", "gyroscope", "magnetometer"}
        assert ("alignment" in made) == (name != "pelvis")
        assert made["accelerometer"]["recording"] == "tray.mcap"
        assert "alignment" not in made or made["alignment"]["recording"] == "worn.mcap"
        for sensor in ("accelerometer", "gyroscope", "magnetometer"):
            assert made[sensor]["residual_after"] < 0.2 * made[sensor]["residual_before"]
    assert "left_shank" in done.said


@pytest.mark.long
def test_the_recordings_serve_the_offline_commands(done: Done, tmp_path: Path) -> None:
    from typer.testing import CliRunner

    from deploy.calibrate.commands import app

    tray = str(done.folder / "tray.mcap")
    result = CliRunner().invoke(
        app, ["imu", tray, "--out", str(tmp_path), "--node", "left_foot", "--still-s", "1.2"]
    )
    assert result.exit_code == 0, result.output
    again = load_config(tmp_path / "left_foot.toml", NodeCalibration)
    assert again.accelerometer == file(done, "left_foot").accelerometer


@pytest.mark.long
def test_bad_data_leave_a_node_s_file_as_it_was(done: Done, tmp_path: Path) -> None:
    """Here nobody ever laid the tray down: each node is refused by name, and nothing is written."""
    suit = loaded("suit").model_copy(update={"motion": "calibration_pose", "grade": "raw", "seed": SEED})
    wearer = _wearer(suit, done.config.skeleton)
    led = LiveSession(done.config, GuideOptions(("imu", "mag")), tmp_path, Console(file=io.StringIO()))
    led.begin()
    for tick in range(8 * RATE_HZ):
        led.on_sweep(sweeps(wearer, tick, silent=(0,)))
        if tick % 50 == 0:
            led.take()
    led._guide.word()  # "go on with what there is"
    led.end()
    console = Console(file=io.StringIO())
    _, refusals = compute(done.config, led.session, Choice(("imu", "mag"), 9.80665, 2.0), tmp_path, console)
    assert len(refusals) == 2 * (len(done.config.skeleton.segment_names) - 1)
    assert "too few attitudes" in refusals[0]
    assert list(tmp_path.glob("*.toml")) == []


@pytest.mark.long
def test_parts_that_are_not_calibrated_now_are_kept(done: Done, tmp_path: Path) -> None:
    old = tmp_path / "old.toml"
    old.write_text("gyroscope = [[2.0, 0, 0, 0], [0, 2.0, 0, 0], [0, 0, 2.0, 0]]  # by hand\n")
    config: MasterConfig = loaded("master", f'nodes.left_foot.calibration="{old}"')
    new = tmp_path / "new"
    new.mkdir()
    inherit(config, new)
    assert [path.name for path in new.iterdir()] == ["left_foot.toml"]
    assert "by hand" in (new / "left_foot.toml").read_text("utf-8")
    (new / "left_foot.toml").write_text("# newer\n")
    inherit(config, new)
    assert (new / "left_foot.toml").read_text("utf-8") == "# newer\n"


@pytest.mark.long
@pytest.mark.parametrize("width", [60, 80, 200])
def test_the_screen_tells_every_node(done: Done, width: int) -> None:
    led = LiveSession(done.config, OPTIONS, done.folder, Console(file=io.StringIO()))
    view = led.take()
    names = done.config.skeleton.segment_names
    text = io.StringIO()
    Console(file=text, width=width).print(screen(view, names, 12.0))
    assert all(name in text.getvalue() for name in names)
    assert view.title in text.getvalue()
    assert "lay it down" in line(view, names, 12.0)


def test_recordings_are_never_written_over(tmp_path: Path) -> None:
    assert free_name(tmp_path, "tray").name == "tray.mcap"
    (tmp_path / "tray.mcap").touch()
    assert free_name(tmp_path, "tray").name == "tray-2.mcap"


@pytest.mark.parametrize(
    ("text", "expected"),
    [("imu", ("imu",)), ("align, imu", ("imu", "align")), ("mag,imu,align", ("imu", "mag", "align"))],
)
def test_what_is_wanted(text: str, expected: tuple[What, ...]) -> None:
    assert parts(text) == expected


@pytest.mark.parametrize("text", ["", "imu,gyro", ","])
def test_what_there_is_not_is_one_line(text: str) -> None:
    with pytest.raises(TandemError, match=r"--what = .*: expected one or more of imu, mag, align"):
        parts(text)
