"""x-IMU3 of x-io Technologies: a folder of CSV files, one a kind of message, each with its own stamps.

`Inertial.csv`: Timestamp (us), Gyroscope X (deg/s) …, Accelerometer X (g) …; `Magnetometer.csv` in a.u.;
`Quaternion.csv` W, X, Y, Z. The folder's name is the unit's.
"""

from __future__ import annotations

from pathlib import Path

from common.errors import RecordingError
from common.recording.formats.csv_file import read_csv
from common.recording.formats.samples import (
    ReadFile,
    ReadOptions,
    SensorSeries,
    UnitSamples,
)

_FILES = ("Inertial.csv", "HighGAccelerometer.csv", "Magnetometer.csv", "Quaternion.csv")
_NEEDED = "Inertial.csv"


def is_ximu3(folder: Path) -> bool:
    """Whether a folder is one unit's log."""
    return folder.is_dir() and (folder / _NEEDED).is_file()


def read_ximu3(folder: Path, options: ReadOptions) -> ReadFile:
    """The unit of a folder. Raises RecordingError."""
    series: dict[str, SensorSeries] = {}
    notes: list[str] = []
    for name in _FILES:
        path = folder / name
        if not path.is_file():
            continue
        if name == "HighGAccelerometer.csv":
            notes.append(f"{path}: left out, Inertial.csv has the accelerometer")
            continue
        read = read_csv(path, options)
        for quantity, one in read.units[0].series.items():
            series.setdefault(quantity, one)
        notes.extend(read.notes)
    if not series:
        raise RecordingError(f"{folder}: holds no readings of an x-IMU3")
    return ReadFile((UnitSamples(folder.name, series, options.rate_hz),), tuple(notes))
