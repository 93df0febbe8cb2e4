"""`demo --replay` of somebody else's file: a ROS 2 bag moves the robot as tandem's own recording does."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from common.skeleton.full_body import RECORDED_AS
from deploy.experiments.demo.alignment import align
from tests.deploy.experiments.demo.test_alignment import LEGS, knees_deg

SECONDS, RATE_HZ = 30.0, 100.0
KIND = "sensor_msgs/msg/Imu"


def both_files(person: Path, folder: Path) -> tuple[Path, Path]:
    """The first 30 s of a person's legs as tandem's npz, and as a bag with a topic for each segment."""
    count = round(SECONDS * RATE_HZ)
    with np.load(person) as arrays:
        own = {key: arrays[key][:count] for key in arrays.files}
    np.savez(folder / "legs.npz", **own)
    types = get_typestore(Stores.ROS2_JAZZY)
    t = types.types
    vector, unknown = t["geometry_msgs/msg/Vector3"], np.zeros(9)
    nobody = t["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 0.0)
    path = folder / "legs"
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        for segment in LEGS.segment_names:
            connection = writer.add_connection(f"/{segment}/imu", KIND, typestore=types)
            name = RECORDED_AS[segment]
            for time_s, acc, gyr in zip(own["t_s"], own[f"{name}_acc"], own[f"{name}_gyr"], strict=True):
                ns = round(1e9 * time_s)
                stamp = t["builtin_interfaces/msg/Time"](sec=ns // 10**9, nanosec=ns % 10**9)
                message = t[KIND](
                    header=t["std_msgs/msg/Header"](stamp=stamp, frame_id=segment),
                    orientation=nobody, orientation_covariance=unknown,
                    angular_velocity=vector(*map(float, gyr)), angular_velocity_covariance=unknown,
                    linear_acceleration=vector(*map(float, acc)), linear_acceleration_covariance=unknown,
                )  # fmt: skip
                writer.write(connection, ns, types.serialize_cdr(message, KIND))
    return folder / "legs.npz", path


@pytest.mark.long
def test_a_bag_moves_the_robot_as_tandems_own_recording_does(tmp_path: Path, real_person: Path) -> None:
    knees = []
    for file in both_files(real_person, tmp_path):
        (tmp_path / f"aligned_{file.suffix}").mkdir()
        aligned = align(file, LEGS, tmp_path / f"aligned_{file.suffix}")
        assert aligned.left == {}
        knees.append(knees_deg(file, aligned.overrides))
    own, foreign = knees
    assert (own.max(axis=0) > 30.0).all(), "the person bends the knees"
    assert len(own) == len(foreign)
    assert np.abs(own - foreign).max() < 0.1
