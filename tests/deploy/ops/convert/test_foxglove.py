"""A recording for viewers, read by the official schemas' decoder and by rosbags."""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path
from typing import Any

import mcap.reader
import numpy as np
import pytest
from typer.testing import CliRunner

from common.quaternion import multiply, rotate
from common.skeleton import WORLD, load_skeleton
from common.skeleton.links import hinge_values, place_links
from deploy import cli
from deploy.sim.world.world import VirtualWorld
from slave.model.capsules import links
from tests.deploy.recorded.virtual import RecordedRun, record_run

mcap_protobuf = pytest.importorskip("mcap_protobuf.decoder")


def follow(world: VirtualWorld) -> None:
    world.engage()
    world.run(1.0)


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> RecordedRun:
    return record_run(tmp_path_factory.mktemp("foxglove"), follow, with_pictures=True)


@pytest.fixture(scope="module")
def exported(run: RecordedRun, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("out") / "run.mcap"
    result = CliRunner().invoke(cli.app, ["export", str(run.slave), "--to", "foxglove", "--out", str(out)])
    assert result.exit_code == 0, result.output
    return out


def decoded(path: Path) -> dict[str, list[Any]]:
    """Every protobuf message by topic, decoded by its own schema alone."""
    found: dict[str, list[Any]] = defaultdict(list)
    with path.open("rb") as stream:
        reader = mcap.reader.make_reader(stream, decoder_factories=[mcap_protobuf.DecoderFactory()])
        for schema, channel, message in reader.iter_messages():
            if channel.message_encoding == "protobuf":
                decode = mcap_protobuf.DecoderFactory().decoder_for("protobuf", schema)
                found[channel.topic].append(decode(message.data))
    return found


def test_the_frames_stand_where_the_profile_s_kinematics_stand(exported: Path) -> None:
    skeleton = load_skeleton("nursing")
    topics = decoded(exported)
    assert len(topics["/tf"]) == len(topics["/joint_states"]) > 100
    for number in (0, len(topics["/tf"]) // 2, len(topics["/tf"]) - 1):
        angles = {joint.name: joint.position for joint in topics["/joint_states"][number].joints}
        values = hinge_values(skeleton.joints, np.array([angles[name] for name in skeleton.joint_names]))
        expected = place_links(links(skeleton), values)
        found = {"tf#/": (np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]))}
        for one in topics["/tf"][number].transforms:
            origin, q_parent = found[one.parent_frame_id]
            t, r = one.translation, one.rotation
            at = origin + rotate(q_parent, np.array([t.x, t.y, t.z]))
            found[one.child_frame_id] = at, multiply(q_parent, np.array([r.w, r.x, r.y, r.z]))
        for link, (origin, q) in expected.items():
            np.testing.assert_allclose(found[link][0], origin, atol=1e-9)
            assert abs(found[link][1] @ q) == pytest.approx(1.0, abs=1e-9)
        assert WORLD in found


def test_the_schemas_are_foxglove_s_own(exported: Path) -> None:
    with exported.open("rb") as stream:
        summary = mcap.reader.make_reader(stream).get_summary()
    assert summary is not None
    schemas = {c.topic: summary.schemas[c.schema_id] for c in summary.channels.values()}
    assert {topic: (schema.name, schema.encoding) for topic, schema in schemas.items()} == {
        "/robot_description": ("std_msgs/msg/String", "ros2msg"),
        "/tf": ("foxglove.FrameTransforms", "protobuf"),
        "/joint_states": ("foxglove.JointStates", "protobuf"),
        "/targets": ("foxglove.JointStates", "protobuf"),
        "/operator": ("foxglove.JointStates", "protobuf"),
        "/camera/head": ("foxglove.CompressedImage", "protobuf"),
        "/camera/head/calibration": ("foxglove.CameraCalibration", "protobuf"),
        "/log": ("foxglove.Log", "protobuf"),
        "/guard": ("tandem.Guard", "protobuf"),
        "/latency": ("tandem.Latency", "protobuf"),
    }


def test_rosbags_reads_the_robot_description(exported: Path) -> None:
    from rosbags.typesys import Stores, get_typestore

    types = get_typestore(Stores.ROS2_JAZZY)
    with exported.open("rb") as stream:
        messages = mcap.reader.make_reader(stream).iter_messages(topics=["/robot_description"])
        read: list[Any] = [types.deserialize_cdr(m.data, "std_msgs/msg/String") for _, _, m in messages]
    texts = [message.data for message in read]
    assert len(texts) == 1
    assert texts[0].startswith('<robot name="nursing">')


def test_pictures_guard_latency_and_log_come_back(exported: Path) -> None:
    topics = decoded(exported)
    picture, calibration = topics["/camera/head"][0], topics["/camera/head/calibration"][0]
    assert picture.format == "jpeg"
    assert bytes(picture.data[:2]) == b"\xff\xd8"
    assert (calibration.width, calibration.height) == (320, 240)
    assert calibration.K[4] == pytest.approx(120.0 / np.tan(np.radians(35.0)))
    frames = {one.child_frame_id for one in topics["/tf"][-1].transforms}
    assert picture.frame_id == calibration.frame_id == "camera_head"
    assert picture.frame_id in frames
    assert {message.state for message in topics["/guard"]} >= {"hold", "align", "track"}
    assert any("follows" in line.message for line in topics["/log"])
    late = [m.one_way_ms for m in topics["/latency"]]
    assert len(late) > 5
    assert all(1.0 < value < 4.0 for value in late[1:]), "the link takes 2 ms"
    assert all(0.0 < m.bound_ms < 3.0 for m in topics["/latency"])
