"""`tandem export`: each file is read back by somebody else's reader, and says what was recorded."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bvh import Bvh
from rosbags.highlevel import AnyReader
from scipy.spatial.transform import Rotation
from typer.testing import CliRunner

from common.errors import TandemError
from common.quaternion import Array, to_matrix
from common.recording import McapRecorder
from common.skeleton import Skeleton, load_skeleton
from common.skeleton.kinematics import orientations, origins
from common.wire.codec import encode
from common.wire.messages import Command, CommandStamps, RobotState
from deploy.cli import app

NURSING = load_skeleton("nursing")
RATE_HZ, COUNT = 50.0, 60
RNG = np.random.default_rng(3)
SHARE = 0.5 + 0.45 * np.sin(
    RNG.uniform(0.5, 2.0, 25) * np.arange(COUNT)[:, None] / RATE_HZ + RNG.uniform(0, 6, 25)
)
ANGLES: Array = NURSING.lower_rad + SHARE * (NURSING.upper_rad - NURSING.lower_rad)
TIME_S: Array = np.arange(COUNT) / RATE_HZ
LOST = (20, 4)
"""Row and joint of an encoder that did not answer."""


def state(k: int) -> RobotState:
    valid = np.ones(25, np.bool_)
    valid[LOST[1]] = k != LOST[0]
    at_ns = 5_000_000_000 + round(1e9 * TIME_S[k])
    return RobotState(
        "robot-1", k + 1, at_ns, at_ns, "track", "", "nurse-1", valid, ANGLES[k], ANGLES[k] + 0.01, None, 0, 1
    )


def command(k: int) -> Command:
    at_ns = 9_000_000_000 + round(1e9 * TIME_S[k])
    valid = np.ones(25, np.bool_)
    stamps = CommandStamps(at_ns, at_ns, at_ns, at_ns)
    return Command("robot-1", 7, k + 1, k, stamps, True, valid, ANGLES[k] - 0.01, np.zeros(25))


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("recorded") / "morning.mcap"
    with McapRecorder(path, {"robot": "robot-1"}, wall=lambda: 1_700_000_000_000_000_000) as recorder:
        for k in range(COUNT):
            recorder.put("tandem/robot-1/state", encode(state(k)), k)
            recorder.put("tandem/robot-1/operator/nurse-1/command", encode(command(k)), k)
            # the same reading of the encoders, told once more
            recorder.put("tandem/robot-1/state", encode(replace(state(k), sequence=100 + k)), k)
    return path


def run(*words: object) -> str:
    found = CliRunner().invoke(app, ["export", *map(str, words)])
    if found.exception is not None and not isinstance(found.exception, SystemExit):
        raise found.exception
    assert found.exit_code == 0, found.output
    return found.output


def expected(missing: float) -> Array:
    """The encoders' angles, with what stands for the one that did not answer."""
    out = ANGLES.copy()
    out[LOST] = missing
    return out


HELD = expected(ANGLES[LOST[0] - 1, LOST[1]])


def test_csv(recorded: Path, tmp_path: Path) -> None:
    out = tmp_path / "a.csv"
    assert "60 rows of 25 joints" in run(recorded, "--out", out)
    table = np.genfromtxt(out, delimiter=",", names=True)
    assert table.dtype.names == ("time_s", *(f"{name}_rad" for name in NURSING.joint_names))
    np.testing.assert_allclose(table["time_s"], TIME_S, atol=1e-9)
    read = np.stack([table[f"{name}_rad"] for name in NURSING.joint_names], axis=-1)
    np.testing.assert_allclose(read, expected(np.nan), rtol=0, atol=1e-6)


@pytest.mark.parametrize(("of", "add"), [("targets", 0.01), ("operator", -0.01)])
def test_whose_angles(recorded: Path, tmp_path: Path, of: str, add: float) -> None:
    out = tmp_path / "a.csv"
    run(recorded, "--out", out, "--of", of)
    table = np.loadtxt(out, delimiter=",", skiprows=1)
    np.testing.assert_allclose(table[:, 1:], ANGLES + add, rtol=0, atol=1e-6)


def test_opensim_motion(recorded: Path, tmp_path: Path) -> None:
    out = tmp_path / "a.mot"
    assert "1 angles that were not valid are held" in run(recorded, "--to", "mot", "--out", out)
    lines = out.read_text().splitlines()
    end = lines.index("endheader")
    assert "nRows=60" in lines[:end]
    assert "nColumns=26" in lines[:end]
    assert "inDegrees=yes" in lines[:end]
    assert lines[end + 1].split("\t") == ["time", *NURSING.joint_names]
    table = np.loadtxt(lines[end + 2 :])
    np.testing.assert_allclose(table[:, 1:], np.degrees(HELD), rtol=0, atol=np.degrees(1e-6))


def of_bvh(skeleton: Skeleton, file: Bvh, frame: int) -> tuple[Array, Array]:
    """World rotations (N, 3, 3) and places (N, 3) in BVH's frame, by its own hierarchy."""
    turn: dict[str, Array] = {"base": np.eye(3)}
    place: dict[str, Array] = {"base": np.zeros(3)}
    channels = ["Zrotation", "Xrotation", "Yrotation"]
    for name in file.get_joints_names()[1:]:
        parent = file.joint_parent(name).name
        angles = file.frame_joint_channels(frame, name, channels)
        place[name] = place[parent] + turn[parent] @ np.array(file.joint_offset(name))
        turn[name] = turn[parent] @ Rotation.from_euler("ZXY", angles, degrees=True).as_matrix()
    names = skeleton.segment_names
    return np.array([turn[n] for n in names]), np.array([place[n] for n in names])


def test_bvh_stands_as_the_robot_stood(recorded: Path, tmp_path: Path) -> None:
    out = tmp_path / "a.bvh"
    run(recorded, "--to", "bvh", "--out", out)
    file = Bvh(out.read_text())
    assert (file.nframes, file.frame_time) == (COUNT, pytest.approx(1.0 / RATE_HZ))
    to_bvh = np.eye(3)[[1, 2, 0]]
    for frame in (0, LOST[0], COUNT - 1):
        q = orientations(NURSING, HELD[frame])
        turn, place = of_bvh(NURSING, file, frame)
        np.testing.assert_allclose(turn, to_bvh @ to_matrix(q) @ to_bvh.T, rtol=0, atol=1e-6)
        np.testing.assert_allclose(place, origins(NURSING, q) @ to_bvh.T, rtol=0, atol=1e-5)


@pytest.mark.parametrize("to", ["bag", "mcap"])
def test_a_bag_of_joint_states(recorded: Path, tmp_path: Path, to: str) -> None:
    out = tmp_path / "bag"
    run(recorded, "--to", to, "--out", out)
    with AnyReader([out]) as reader:
        (connection,) = reader.connections
        assert (connection.topic, connection.msgtype) == ("/joint_states", "sensor_msgs/msg/JointState")
        rows = [(at, reader.deserialize(data, connection.msgtype)) for _, at, data in reader.messages()]
    assert len(rows) == COUNT
    for k, (at, message) in enumerate(rows):
        lost = k == LOST[0]
        names = [name for j, name in enumerate(NURSING.joint_names) if not (lost and j == LOST[1])]
        assert message.name == names, "a joint without a reading is not told"  # type: ignore[attr-defined]
        wanted = np.delete(ANGLES[k], LOST[1]) if lost else ANGLES[k]
        np.testing.assert_allclose(message.position, wanted, rtol=0, atol=1e-6)  # type: ignore[attr-defined]
        assert at == 1_700_000_000_000_000_000 + round(1e9 * TIME_S[k])
        stamp = message.header.stamp  # type: ignore[attr-defined]
        assert stamp.sec * 10**9 + stamp.nanosec == at
    with pytest.raises(TandemError, match="bag: "):
        run(recorded, "--to", to, "--out", out)


def test_what_cannot_be_exported_is_said(recorded: Path, tmp_path: Path) -> None:
    with pytest.raises(TandemError, match=r"none of its 120 states fits the profile hand .* --profile NAME"):
        run(recorded, "--profile", "hand", "--out", tmp_path / "a.csv")
    with pytest.raises(TandemError, match=r"expected a name that ends in \.mot"):
        run(recorded, "--to", "mot", "--out", tmp_path / "a.csv")
    empty = tmp_path / "empty.mcap"
    with McapRecorder(empty, {"robot": "robot-1"}):
        pass
    with pytest.raises(TandemError, match="holds no states"):
        run(empty, "--out", tmp_path / "a.csv")
    (tmp_path / "a.csv").write_text("mine")
    with pytest.raises(TandemError, match="is there already"):
        run(recorded, "--out", tmp_path / "a.csv")
    assert (tmp_path / "a.csv").read_text() == "mine"
