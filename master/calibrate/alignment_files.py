"""The nodes' files around an alignment: readings calibrated by them, and the alignment written to them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from datetime import date
from pathlib import Path

import numpy as np

from common.config.load import load_config
from common.config.sensor_calibration import Made, NodeCalibration
from common.quaternion import Array
from common.skeleton import Skeleton
from common.skeleton.full_body import RECORDED_AS
from master.calibrate.alignment import SuitAlignment
from master.calibrate.node_file import write_calibration
from master.calibrate.recording import NodeRecording, RecordingError


def node_file(folder: Path, name: str) -> Path:
    """A node's file in a folder of them."""
    return folder / f"{name}.toml"


def of_profile(recordings: Mapping[str, NodeRecording], skeleton: Skeleton) -> dict[str, NodeRecording]:
    """The recordings by the skeleton's segments, also where the file has the full-body names for them.

    Raises RecordingError where no node is one of the skeleton's.
    """
    out = {}
    for segment in skeleton.segment_names:
        name = segment if segment in recordings else RECORDED_AS.get(segment)
        if name is not None and name in recordings:
            out[segment] = recordings[name]
    if not out:
        there = ", ".join(sorted(recordings)[:6])
        raise RecordingError(
            f"no node of the recording ({there} …) is a segment of the profile {skeleton.name}; "
            "expected another --profile"
        )
    return out


def calibrated(recordings: Mapping[str, NodeRecording], folder: Path) -> dict[str, NodeRecording]:
    """The readings with the maps of `folder`'s NODE.toml applied; as they are where there is no such file.

    Raises RecordingError for raw counts without a file, ConfigError for a file that is not sound.
    """
    out = {}
    for name, raw in recordings.items():
        path = node_file(folder, name)
        if not path.exists():
            if raw.counts:
                raise RecordingError(f"{name}: raw counts; calibrate it first (`tandem calibrate imu`)")
            out[name] = raw
            continue
        file = load_config(path, NodeCalibration)
        out[name] = replace(
            raw,
            acc_m_s2=_mapped(file.accelerometer, raw.acc_m_s2),
            gyr_rad_s=_mapped(file.gyroscope, raw.gyr_rad_s),
            mag_ut=None if raw.mag_ut is None else _mapped(file.magnetometer, raw.mag_ut),
            counts=False,
            as_read=raw,
        )
    return out


def write_alignment(alignment: SuitAlignment, recording: Path, folder: Path, day: date) -> dict[str, Path]:
    """Write each node's alignment to its file; other parts of the files stay. Returns the files by node."""
    written = {}
    for name, node in alignment.nodes.items():
        made = Made(
            date=day,
            recording=recording.name,
            unit="rad",
            residual_after=None if node.tilt_rad is None else abs(node.tilt_rad),
            sigma=[[min(node.sigma_rad, math.pi)]],
        )
        written[name] = node_file(folder, name)
        write_calibration(written[name], {"alignment": (node.q_sensor_from_segment, made)})
    return written


def _mapped(rows: list[list[float]], readings: Array) -> Array:
    matrix = np.array(rows)
    out: Array = readings @ matrix[:, :3].T + matrix[:, 3]
    return out
