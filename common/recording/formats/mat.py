"""MATLAB files (.mat, up to version 7) with arrays of one unit, as BROAD's and most labs' are."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from common.errors import RecordingError
from common.quaternion import Array
from common.recording.formats.samples import (
    ACC,
    GYR,
    MAG,
    MOVEMENT,
    POSITION,
    QUAT,
    TIME,
    WIDTHS,
    ReadFile,
    ReadOptions,
    SensorSeries,
    UnitSamples,
)
from common.recording.formats.units import SI, factor

_NAMES: Mapping[str, tuple[str, ...]] = {
    ACC: ("imu_acc", "acc", "accel", "accelerometer", "acceleration"),
    GYR: ("imu_gyr", "gyr", "gyro", "gyroscope", "angular_velocity", "angularvelocity"),
    MAG: ("imu_mag", "mag", "magnetometer", "magnetic_field", "magneticfield"),
    QUAT: ("opt_quat", "quat", "quaternion", "orientation", "q"),
    POSITION: ("opt_pos", "pos", "position"),
    MOVEMENT: ("movement",),
    TIME: ("t_s", "time", "t", "timestamp"),
}
_RATES = ("sampling_rate", "rate_hz", "fs", "samplerate", "sample_rate", "rate")
Variables = dict[str, NDArray[np.generic]]


def read_mat(path: Path, options: ReadOptions) -> ReadFile:
    """The unit of a file, its arrays at the top or in one struct. Raises RecordingError."""
    variables = _variables(path)
    by_low = {name.lower(): name for name in variables}
    chosen = {q: next((by_low[n] for n in names if n in by_low), None) for q, names in _NAMES.items()}
    chosen |= {key.rpartition(".")[2]: columns[0] for key, columns in options.columns.items()}
    rate = options.rate_hz or next(
        (float(variables[by_low[n]].ravel()[0]) for n in _RATES if n in by_low),
        None,
    )
    notes, series = [], {}
    time_name = chosen.get(TIME)
    time_s: Array | None = None
    if rate is None and time_name is not None:
        scale = factor(str(path), TIME, options.units.get(TIME, "s"))
        time_s = scale * variables[time_name].astype(np.float64).ravel()
    elif rate is None:
        raise RecordingError(
            f"{path}: has neither times ({', '.join(_NAMES[TIME])}) nor a rate; give --rate HZ"
        )
    for quantity, name in chosen.items():
        if name is None or quantity == TIME:
            continue
        if name not in variables:
            raise RecordingError(f"{path}: has no array {name}; it has {', '.join(variables)}")
        unit = options.units.get(quantity)
        scale = 1.0 if unit is None else factor(str(path), quantity, unit)
        values = _rows(path, name, variables[name], WIDTHS[quantity])
        series[quantity] = SensorSeries(scale * values, time_s, time_name or "time")
        told = unit or SI.get(quantity)
        notes.append(f"{path}: {quantity} is {name}" + (f", taken as {told}" if told else ""))
    if not {ACC, GYR, QUAT} & set(series):
        raise RecordingError(
            f"{path}: none of its arrays {', '.join(variables)} is a sensor's by its name; give them, as "
            "--columns acc=NAME --columns gyr=NAME"
        )
    assumed = frozenset(quantity for quantity in series if quantity not in options.units)
    return ReadFile((UnitSamples(path.stem, series, rate, assumed=assumed),), tuple(notes))


def _variables(path: Path) -> Variables:
    from scipy.io import loadmat

    try:
        found = loadmat(path)
    except NotImplementedError:  # scipy's word for version 7.3
        raise RecordingError(f"{path}: is of version 7.3 (HDF5); save it again by save(…, '-v7')") from None
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read ({error.strerror or error})") from None
    except Exception as error:  # a torn file raises what zlib, struct and numpy have
        raise RecordingError(f"{path}: is not a readable MATLAB file ({type(error).__name__})") from None
    out: Variables = {}
    for name, value in found.items():
        if name.startswith("__"):
            continue
        if value.dtype.names and value.size == 1:  # a struct: its fields
            out |= {field: np.asarray(value[field].ravel()[0]) for field in value.dtype.names}
        else:
            out[name] = value
    return {name: value for name, value in out.items() if value.dtype.kind in "fiub"}


def _rows(path: Path, name: str, values: NDArray[np.generic], width: int) -> Array:
    out = values.astype(np.float64)
    if out.ndim == 2 and out.shape[1] != width and out.shape[0] == width:
        out = out.T
    if width == 1:
        out = out.reshape(-1, 1)
    if out.ndim != 2 or out.shape[1] != width:
        raise RecordingError(f"{path}: {name} has the shape {values.shape}; expected (T, {width})")
    return out
