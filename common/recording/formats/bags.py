"""ROS bags: `sensor_msgs/Imu` and `MagneticField` of ROS 1 (.bag) and ROS 2 (folder, .db3, .mcap).

A unit is what stands before the last parts of its topics: /left_hand/imu/data and /left_hand/imu/mag are one.
"""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np

from common.errors import RecordingError
from common.recording.formats.samples import (
    ACC,
    GYR,
    MAG,
    QUAT,
    ReadFile,
    ReadOptions,
    SensorSeries,
    UnitSamples,
)

_IMU, _FIELD = "sensor_msgs/msg/Imu", "sensor_msgs/msg/MagneticField"
_OF_A_TOPIC = {"imu", "data", "data_raw", "mag", "magnetic_field", "raw", "sample", "accel_gyro"}
_WIDTHS = {ACC: 3, GYR: 3, MAG: 3, QUAT: 4}
Rows = dict[str, list[tuple[float, ...]]]


def is_bag(path: Path) -> bool:
    """Whether it is a bag of ROS by its name, or a folder with a bag's metadata."""
    return path.suffix.lower() in (".bag", ".db3") or (path.is_dir() and (path / "metadata.yaml").is_file())


def read_bag(path: Path, options: ReadOptions) -> ReadFile:
    """Every unit with an Imu topic. Raises RecordingError; ModuleNotFoundError without the extra `ros`."""
    from rosbags.highlevel import AnyReader, AnyReaderError
    from rosbags.interfaces import Connection
    from rosbags.typesys import Stores, get_typestore

    rows: defaultdict[str, Rows] = defaultdict(lambda: defaultdict(list))
    unreadable, topics, last_error = 0, set(), ""
    try:
        with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_JAZZY)) as reader:
            wanted: list[Connection] = [c for c in reader.connections if c.msgtype in (_IMU, _FIELD)]
            for connection, _, data in reader.messages(wanted):
                topics.add(connection.topic)
                try:
                    message = reader.deserialize(data, connection.msgtype)
                    _take(rows[_unit(connection.topic)], connection.msgtype, message)
                except (AnyReaderError, AttributeError, ValueError) as error:
                    unreadable, last_error = unreadable + 1, str(error)
            others = sorted({c.msgtype for c in reader.connections} - {_IMU, _FIELD})
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read ({error.strerror or error})") from None
    except Exception as error:  # a torn bag raises what sqlite, zstd, struct and the reader have
        if not rows:
            raise RecordingError(f"{path}: is not a readable bag ({error})") from None
        last_error = f"it was cut off: {error}"
    units = tuple(_samples(name, found, options) for name, found in rows.items() if found[GYR])
    if not units:
        raise RecordingError(f"{path}: holds no {_IMU}; it has {', '.join(others) if not rows else _FIELD}")
    notes = [f"{path}: {', '.join(sorted(topics))}; m/s² and rad/s, the field from T to µT (REP-145)"]
    if unreadable or last_error:
        notes.append(f"{path}: {unreadable} messages could not be read ({last_error})")
    return ReadFile(units, tuple(notes))


def _unit(topic: str) -> str:
    parts = [part for part in topic.split("/") if part]
    kept = list(parts)
    while len(kept) > 1 and kept[-1] in _OF_A_TOPIC:
        kept.pop()
    return "_".join(kept)


def _take(rows: Rows, kind: str, message: Any) -> None:
    """Take a message, whose class rosbags makes from the definition in the bag: no type is known of it."""
    stamp = message.header.stamp
    at = stamp.sec + 1e-9 * stamp.nanosec
    if kind == _FIELD:
        field = message.magnetic_field
        rows[MAG].append((at, 1e6 * field.x, 1e6 * field.y, 1e6 * field.z))
        return
    acc, gyr = message.linear_acceleration, message.angular_velocity
    rows[ACC].append((at, acc.x, acc.y, acc.z))
    rows[GYR].append((at, gyr.x, gyr.y, gyr.z))
    # a first covariance of -1 says that there is no orientation; all zeros says nothing is known of it
    q = message.orientation
    if message.orientation_covariance[0] != -1.0 and any((q.w, q.x, q.y, q.z)):
        rows[QUAT].append((at, q.w, q.x, q.y, q.z))


def _samples(name: str, rows: Rows, options: ReadOptions) -> UnitSamples:
    series = {}
    for quantity, width in _WIDTHS.items():
        if rows[quantity]:
            table = np.array(rows[quantity])
            series[quantity] = SensorSeries(table[:, 1 : 1 + width], table[:, 0], f"{name} header.stamp")
    return UnitSamples(name, series, options.rate_hz)
