"""Joint angles as tables (CSV, OpenSim .mot) and as a ROS 2 bag."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from common.errors import RecordingError
from deploy.ops.convert.joints import JointSeries
from deploy.report.output import writing


def write_csv(path: Path, series: JointSeries) -> str:
    """A column `time_s` and one `NAME_rad` a joint; an empty cell where a joint was not valid."""
    rows = [",".join(["time_s", *(f"{name}_rad" for name in series.names)])]
    for time_s, angles in zip(series.time_s.tolist(), series.position_rad.tolist(), strict=True):
        rows.append(",".join([f"{time_s:.9f}", *("" if a != a else f"{a:.9g}" for a in angles)]))
    _write(path, "\n".join(rows) + "\n")
    return ""


def write_mot(path: Path, series: JointSeries) -> str:
    """OpenSim's motion file: coordinates in degrees. What was missing is held, as it takes no gaps."""
    held, missing = series.held()
    names = "\t".join(["time", *series.names])
    size = f"nRows={len(held)}\nnColumns={1 + len(series.names)}"
    head = f"{path.stem}\nversion=1\n{size}\ninDegrees=yes\nendheader\n"
    rows = [
        "\t".join([f"{time_s:.9f}", *(f"{angle:.9g}" for angle in angles)])
        for time_s, angles in zip(series.time_s.tolist(), np.degrees(held).tolist(), strict=True)
    ]
    _write(path, head + names + "\n" + "\n".join(rows) + "\n")
    return f"{missing} angles that were not valid are held at the last valid one" if missing else ""


def write_bag(path: Path, series: JointSeries, *, mcap: bool, topic: str = "/joint_states") -> str:
    """A ROS 2 bag (a folder) of JointState. Raises ModuleNotFoundError without the extra `ros`."""
    from rosbags.rosbag2 import StoragePlugin, Writer, WriterError

    from deploy.ros.cdr import JOINT_STATE, joint_state, types

    plugin = StoragePlugin.MCAP if mcap else StoragePlugin.SQLITE3
    try:
        with writing(path), Writer(path, version=9, storage_plugin=plugin) as writer:
            connection = writer.add_connection(topic, JOINT_STATE, typestore=types())
            for at_ns, angles in zip(series.time_ns.tolist(), series.position_rad, strict=True):
                stamp_ns = series.wall_ns + at_ns - int(series.time_ns[0])
                writer.write(connection, stamp_ns, joint_state(series.names, angles, stamp_ns))
    except WriterError as error:
        raise RecordingError(f"{path}: {error}") from None
    return f"a folder; topic {topic}; stamps begin when the recording began"


def _write(path: Path, text: str) -> None:
    if path.exists():
        raise RecordingError(f"{path}: is there already; name another file, or move it away")
    with writing(path):
        path.write_text(text, "utf-8")
