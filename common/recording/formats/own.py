"""tandem's own recordings, and the npz files of arrays that it takes besides."""

from __future__ import annotations

import logging
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
    QUAT,
    ReadFile,
    ReadOptions,
    SensorSeries,
    UnitSamples,
)
from common.recording.npz import Arrays, read_arrays
from common.recording.sweeps import read_sweeps

log = logging.getLogger(__name__)
_RATE_UNKNOWN_HZ = 100.0
"""Of a magnetometer alone without times: what is held out are blocks of two seconds."""


def read_npz(path: Path, options: ReadOptions) -> ReadFile:
    """Arrays of one unit, of one unit in raw counts, or of a suit. Raises RecordingError."""
    arrays = read_arrays(path)
    if "acc_raw" in arrays:
        unit = _raw_unit(path, arrays)
    elif "acc" in arrays or "gyr" in arrays or "mag" in arrays:
        unit = _single_unit(path, arrays, options.rate_hz)
    else:
        return ReadFile(_suit(path, arrays))
    return ReadFile((unit,))


def _raw_unit(path: Path, arrays: Arrays) -> UnitSamples:
    time_s = _times(path, "t", _need(path, arrays, "t"))
    series = {q: SensorSeries(_vectors(path, arrays, f"{q}_raw"), time_s, "t") for q in (ACC, GYR)}
    if "mag_raw" in arrays:
        series[MAG] = SensorSeries(_vectors(path, arrays, "mag_raw"), time_s, "t")
    return UnitSamples(path.stem, series, counts=True)


def _single_unit(path: Path, arrays: Arrays, rate_hz: float | None) -> UnitSamples:
    time_s, key = None, "time"
    if "acc" not in arrays and "gyr" not in arrays:
        # enough for hard and soft iron, which need no times; a rate that is not given is of no account
        rate_hz = _rate(path, arrays["rate_hz"]) if "rate_hz" in arrays else rate_hz or _RATE_UNKNOWN_HZ
        return UnitSamples(path.stem, {MAG: SensorSeries(_vectors(path, arrays, "mag"))}, rate_hz)
    values = {q: _vectors(path, arrays, q) for q in (ACC, GYR)}
    if "mag" in arrays:
        values[MAG] = _vectors(path, arrays, "mag")
    if "rate_hz" in arrays:
        rate_hz = _rate(path, arrays["rate_hz"])
    else:
        key = next((k for k in ("t_s", "t") if k in arrays), "")
        if not key:
            raise RecordingError(f"{path}: has neither rate_hz nor t_s; add the rate in Hz")
        time_s = _times(path, key, arrays[key])
    for quantity, width in ((QUAT, 4), (MOVEMENT, 1)):
        found = arrays.get(quantity)
        if found is not None and found.dtype.kind in "biuf" and found.size == width * len(values[GYR]):
            values[quantity] = found.astype(np.float64).reshape(-1, width)
    return UnitSamples(path.stem, {q: SensorSeries(v, time_s, key) for q, v in values.items()}, rate_hz)


def _suit(path: Path, arrays: Arrays) -> tuple[UnitSamples, ...]:
    names = [key.removesuffix("_gyr") for key in arrays if key.endswith("_gyr")]
    if not names:
        raise RecordingError(
            f"{path}: has no gyroscope; expected gyr and acc of a unit, acc_raw and gyr_raw of a unit, "
            "or {segment}_gyr and {segment}_acc of a suit"
        )
    time_s = _times(path, "t_s", _need(path, arrays, "t_s"))
    units = []
    for name in names:
        series = {q: SensorSeries(_vectors(path, arrays, f"{name}_{q}"), time_s, "t_s") for q in (ACC, GYR)}
        if f"{name}_mag" in arrays:
            series[MAG] = SensorSeries(_vectors(path, arrays, f"{name}_mag"), time_s, "t_s")
        quat = arrays.get(f"{name}_quat")
        if quat is not None and quat.shape == (len(time_s), 4) and quat.dtype.kind in "fiu":
            series[QUAT] = SensorSeries(quat.astype(np.float64), time_s, "t_s")
        units.append(UnitSamples(name, series))
    return tuple(units)


def _need(path: Path, arrays: Arrays, key: str) -> NDArray[np.generic]:
    if key not in arrays:
        raise RecordingError(f"{path}: has no array {key}")
    return arrays[key]


def _vectors(path: Path, arrays: Arrays, key: str) -> Array:
    values = _need(path, arrays, key)
    if values.ndim != 2 or values.shape[1] != 3 or values.dtype.kind not in "fiu" or len(values) < 2:
        raise RecordingError(
            f"{path}: {key} is {values.dtype} of shape {values.shape}; expected numbers, a row of 3 a sample"
        )
    return values.astype(np.float64)


def _rate(path: Path, rate_hz: NDArray[np.generic]) -> float:
    if rate_hz.size != 1 or rate_hz.dtype.kind not in "fiu":
        raise RecordingError(f"{path}: rate_hz is {rate_hz!s:.40}; expected one number, Hz")
    return float(rate_hz.reshape(()))


def _times(path: Path, key: str, times: NDArray[np.generic]) -> Array:
    if times.ndim != 1 or len(times) < 2 or times.dtype.kind not in "fiu":
        raise RecordingError(f"{path}: {key} must be a row of times, one a sample, s")
    return times.astype(np.float64)


def read_suit_mcap(path: Path, _: ReadOptions) -> ReadFile:
    """Every node of a suit that answered at least once, by segment; warns where the file was cut off."""
    sweeps = read_sweeps(path)
    if sweeps.cut:
        log.warning("%s: %s; only its first %.1f s are used", path, sweeps.cut, sweeps.duration_s)
    units = []
    for i, name in enumerate(sweeps.nodes):
        acc, gyr, mag = (sweeps.readings[:, i, k : k + 3].astype(np.float64) for k in (0, 3, 6))
        if np.isnan(gyr).all():
            log.warning("%s: never answered", name)
            continue
        series = {ACC: SensorSeries(acc), GYR: SensorSeries(gyr)}
        if not np.isnan(mag).all():
            series[MAG] = SensorSeries(mag)
        units.append(UnitSamples(name, series, sweeps.rate_hz))
    if not units:
        raise RecordingError(f"{path}: no node answered; check the bus and record again")
    return ReadFile(tuple(units))
