"""OpenSim: tables of orientations or of sensors (.sto, .mot) and of markers (.trc).

.sto: lines KEY=VALUE up to `endheader`, then tab-separated columns, `time` first. `DataType=Quaternion` holds
w,x,y,z in a cell, `DataType=Vec3` x,y,z. The name of a Vec3 file tells its quantity, as OpenSim's own reader
of inertial data writes it: `…_linear_accelerations`, `…_angular_velocity`, `…_magnetic_heading`.
.trc: five lines (names of the markers in the fourth), then frame, time and x, y, z of every marker.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from common.errors import RecordingError
from common.quaternion import Array
from common.recording.formats.samples import (
    ACC,
    GYR,
    MAG,
    POSITION,
    QUAT,
    ReadFile,
    ReadOptions,
    SensorSeries,
    UnitSamples,
)
from common.recording.formats.text_table import read_text
from common.recording.formats.units import factor

_OF_NAME = {"accel": ACC, "angular": GYR, "gyro": GYR, "magn": MAG}


def read_sto(path: Path, options: ReadOptions) -> ReadFile:
    """The orientations or readings of every column. Raises RecordingError."""
    lines = read_text(path).splitlines()
    end = next((i for i, line in enumerate(lines) if line.strip().lower() == "endheader"), None)
    if end is None or end + 2 >= len(lines):
        raise RecordingError(f"{path}: expected a line `endheader`, a line of names and rows below")
    header = dict(line.split("=", 1) for line in lines[:end] if "=" in line)
    kind = {key.strip().lower(): value.strip().lower() for key, value in header.items()}.get(
        "datatype", "double"
    )
    quantity = _quantity(path, kind)
    names = lines[end + 1].split()
    width = 4 if quantity == QUAT else 3
    rows = [_row(path, line, len(names), width) for line in lines[end + 2 :] if line.strip()]
    time_s = np.array([row[0] for row in rows])
    values = np.array([row[1:] for row in rows]).reshape(len(rows), len(names) - 1, width)
    unit = options.units.get(quantity)
    scale = 1.0 if unit is None else factor(str(path), quantity, unit)
    units = tuple(
        UnitSamples(_plain(name), {quantity: SensorSeries(scale * values[:, i], time_s)}, options.rate_hz)
        for i, name in enumerate(names[1:])
    )
    notes = [f"{path}: {quantity} of {', '.join(_plain(name) for name in names[1:])}"]
    if quantity == QUAT:
        notes.append(f"{path}: orientations are in the file's own world frame")
    return ReadFile(units, tuple(notes))


def _quantity(path: Path, kind: str) -> str:
    if kind == "quaternion":
        return QUAT
    if kind in ("vec3", "double"):
        found = next((q for word, q in _OF_NAME.items() if word in path.stem.lower()), None)
        if kind == "vec3" and found is not None:
            return found
    raise RecordingError(
        f"{path}: DataType={kind} holds no orientations; expected Quaternion, or Vec3 in a file named "
        "…_linear_accelerations, …_angular_velocity or …_magnetic_heading"
    )


def _row(path: Path, line: str, count: int, width: int) -> list[float]:
    cells = line.split()
    try:
        out = [float(cells[0])]
        for cell in cells[1:]:
            out.extend(float(word) for word in cell.split(","))
    except ValueError:
        out = []
    if len(out) != 1 + width * (count - 1):
        raise RecordingError(
            f"{path}: the row {line[:40]!r} … does not hold a time and {width} numbers for each of "
            f"{count - 1} columns"
        )
    return out


def _plain(name: str) -> str:
    """The column's name without OpenSim's ending for a sensor's frame."""
    return name.rsplit("/", 1)[-1].removesuffix("_imu")


def read_trc(path: Path, options: ReadOptions) -> ReadFile:
    """The positions of every marker, m. Raises RecordingError."""
    lines = [line.rstrip("\r") for line in read_text(path).splitlines()]
    if len(lines) < 7 or not lines[0].startswith("PathFileType"):
        raise RecordingError(f"{path}: expected PathFileType and four more lines above the markers' rows")
    settings = dict(zip(lines[1].split(), lines[2].split(), strict=False))
    unit = options.units.get(POSITION) or settings.get("Units", "mm")
    scale = factor(f"{path}: Units", POSITION, unit)
    names = [name for name in lines[3].split("\t")[2:] if name.strip()]
    rows = [_marker_row(line, len(names)) for line in lines[5:] if line.strip()]
    torn = sum(row is None for row in rows)
    table: Array = np.array([row for row in rows if row is not None])
    if len(table) < 2 or torn > 0.1 * len(rows):
        raise RecordingError(f"{path}: {torn} of {len(rows)} rows do not hold 3 numbers for each marker")
    values = scale * table[:, 2:].reshape(len(table), len(names), 3)
    series = {name.strip(): SensorSeries(values[:, i], table[:, 1]) for i, name in enumerate(names)}
    notes = [f"{path}: positions of {len(names)} markers, in {unit}"]
    if torn:
        notes.append(f"{path}: {torn} torn rows left out")
    units = tuple(UnitSamples(name, {POSITION: one}, options.rate_hz) for name, one in series.items())
    return ReadFile(units, tuple(notes))


def _marker_row(line: str, count: int) -> list[float] | None:
    """Frame, time and coordinates; NaN where a marker was hidden, None where the row is torn."""
    cells = line.split("\t")
    cells += [""] * (2 + 3 * count - len(cells))
    try:
        return [float(cell) if cell.strip() else float("nan") for cell in cells[: 2 + 3 * count]]
    except ValueError:
        return None
