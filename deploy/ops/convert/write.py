"""Writes imported nodes as tandem's own files: npz arrays, or a suit's recording."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from common.errors import RecordingError
from common.quaternion import Array
from common.recording.node import NodeRecording
from common.recording.sweeps import write_sweeps
from common.recording.together import CommonGrid, Values, together
from deploy.report.output import writing

_OF_NODE: Mapping[str, Values] = {
    "gyr": lambda node: node.gyr_rad_s,
    "acc": lambda node: node.acc_m_s2,
    "mag": lambda node: node.mag_ut,
    "quat": lambda node: node.q_world_from_sensor,
    "position": lambda node: node.position_m,
}


def write_npz(path: Path, nodes: Mapping[str, NodeRecording], rate_hz: float | None) -> tuple[str, ...]:
    """One node: gyr, acc, mag, quat, movement, rate_hz. More: t_s, and each with the node's name before it.

    Returns what a person should know. Raises RecordingError where the file is there already.
    """
    grid = together(nodes, rate_hz)
    arrays: dict[str, Array] = {}
    for name, node in nodes.items():
        prefix = "" if len(nodes) == 1 else f"{name}_"
        for key, of in _OF_NODE.items():
            values = grid.values(name, of)
            if values is not None and np.isfinite(values).any():
                arrays[prefix + key] = values
        if len(nodes) == 1 and node.movement is not None:
            movement = grid.values(name, lambda one: _column(one.movement))
            if movement is not None:
                arrays["movement"] = np.nan_to_num(movement[:, 0])
    if len(nodes) == 1:
        arrays["rate_hz"] = np.array(grid.rate_hz)
    else:
        arrays["t_s"] = grid.time_s
    _new(path)
    with writing(path), path.open("xb") as stream:
        np.savez(stream, **arrays)  # type: ignore[arg-type]  # numpy types any key as allow_pickle
    return grid.notes


def write_suit(
    path: Path, nodes: Mapping[str, NodeRecording], rate_hz: float | None, profile: str
) -> tuple[str, ...]:
    """A suit's recording, as `tandem calibrate` takes it. Raises RecordingError."""
    readable = {name: node for name, node in nodes.items() if np.isfinite(node.gyr_rad_s).any()}
    notes = [f"{name}: has no gyroscope, left out" for name in nodes if name not in readable]
    grid = together(readable, rate_hz)
    readings = np.stack([_readings(grid, name) for name in readable], axis=1)
    _new(path)
    with writing(path):
        write_sweeps(path, profile, list(readable), grid.rate_hz, readings)
    if any(node.q_world_from_sensor is not None or node.position_m is not None for node in nodes.values()):
        notes.append("orientations and positions have no place in it: use --to npz to keep them")
    return (*notes, *grid.notes)


def _readings(grid: CommonGrid, name: str) -> Array:
    none = np.full((grid.count, 3), np.nan)
    parts = [grid.values(name, _OF_NODE[key]) for key in ("acc", "gyr", "mag")]
    return np.concatenate([none if part is None else part for part in parts], axis=1)


def _column(values: object) -> Array | None:
    return None if values is None else np.asarray(values, dtype=np.float64)[:, None]


def _new(path: Path) -> None:
    if path.exists():
        raise RecordingError(f"{path}: is there already; name another file, or move it away")
