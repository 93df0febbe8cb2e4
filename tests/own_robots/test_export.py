"""Recordings of robots that are not ours are exported with the path of their profile, and read back."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from bvh import Bvh
from rosbags.highlevel import AnyReader
from typer.testing import CliRunner

from common.quaternion import Array, to_matrix
from common.recording import McapRecorder
from common.skeleton import Skeleton, load_skeleton
from common.skeleton.kinematics import orientations, origins
from common.wire.codec import encode
from common.wire.messages import RobotState
from deploy.cli import app
from tests.deploy.ops.convert.test_export import of_bvh
from tests.robots.imported import FILES, imported

COUNT, RATE_HZ = 30, 50.0


@pytest.fixture(params=FILES)
def profile(request: pytest.FixtureRequest) -> str:
    return str(imported(str(request.param)))


def angles_of(skeleton: Skeleton) -> Array:
    """(T, J) over most of each joint's range."""
    share = 0.5 + 0.45 * np.sin(0.3 * np.arange(COUNT)[:, None] + np.arange(len(skeleton.joints)))
    out: Array = skeleton.lower_rad + share * (skeleton.upper_rad - skeleton.lower_rad)
    return out


def recorded(path: Path, angles: Array) -> Path:
    valid = np.ones(angles.shape[1], np.bool_)
    with McapRecorder(path, {"robot": "robot-1"}, wall=lambda: 1_700_000_000_000_000_000) as recorder:
        for k, row in enumerate(angles):
            at_ns = 5_000_000_000 + round(1e9 * k / RATE_HZ)
            state = RobotState(
                "robot-1", k + 1, at_ns, at_ns, "track", "", "nurse-1", valid, row, row, None, 0, 1
            )
            recorder.put("tandem/robot-1/state", encode(state), k)
    return path


def export(file: Path, profile: str, to: str, out: Path) -> None:
    words = ["export", str(file), "--to", to, "--profile", profile, "--out", str(out)]
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 0, done.output or done.exception


def test_each_format_says_what_was_recorded(profile: str, tmp_path: Path) -> None:
    skeleton = load_skeleton(profile)
    names, angles = list(skeleton.joint_names), angles_of(skeleton)
    file = recorded(tmp_path / "own.mcap", angles)
    export(file, profile, "csv", tmp_path / "a.csv")
    table = np.genfromtxt(tmp_path / "a.csv", delimiter=",", names=True)
    read = np.stack([table[f"{name}_rad"] for name in names], axis=-1)
    np.testing.assert_allclose(read, angles, rtol=0, atol=1e-6)

    export(file, profile, "mot", tmp_path / "a.mot")
    lines = (tmp_path / "a.mot").read_text().splitlines()
    assert lines[lines.index("endheader") + 1].split("\t") == ["time", *names]
    read = np.loadtxt(lines[lines.index("endheader") + 2 :])[:, 1:]
    np.testing.assert_allclose(read, np.degrees(angles), rtol=0, atol=np.degrees(1e-6))

    export(file, profile, "mcap", tmp_path / "bag")
    with AnyReader([tmp_path / "bag"]) as reader:
        (connection,) = reader.connections
        rows = [reader.deserialize(data, connection.msgtype) for _, _, data in reader.messages()]
    assert [list(getattr(row, "name")) for row in rows] == [names] * COUNT  # noqa: B009
    np.testing.assert_allclose([getattr(row, "position") for row in rows], angles, rtol=0, atol=1e-6)  # noqa: B009


def test_bvh_stands_as_the_robot_stood(profile: str, tmp_path: Path) -> None:
    skeleton = load_skeleton(profile)
    angles = angles_of(skeleton)
    export(recorded(tmp_path / "own.mcap", angles), profile, "bvh", tmp_path / "a.bvh")
    file = Bvh((tmp_path / "a.bvh").read_text())
    to_bvh = np.eye(3)[[1, 2, 0]]
    for frame in (0, COUNT // 2, COUNT - 1):
        q = orientations(skeleton, angles[frame])
        turn, place = of_bvh(skeleton, file, frame)
        np.testing.assert_allclose(turn, to_bvh @ to_matrix(q) @ to_bvh.T, rtol=0, atol=1e-6)
        np.testing.assert_allclose(place, origins(skeleton, q) @ to_bvh.T, rtol=0, atol=1e-5)
