"""Recordings as the calibration takes them: the raw readings of one node or of a whole suit, from a file."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from common.errors import RecordingError as RecordingError
from common.quaternion import Array
from common.recording.npz import Arrays, read_arrays
from master.calibrate.stamps import Grid, lay_out

log = logging.getLogger(__name__)

_LOWEST_RATE_HZ, _HIGHEST_RATE_HZ = 5.0, 20_000.0
_RATE_UNKNOWN_HZ = 100.0
"""Of a magnetometer alone without times: what is held out are blocks of two seconds."""


@dataclass(frozen=True, slots=True)
class NodeRecording:
    """One node's readings as they came, evenly spaced; a row of NaN stands where a sample is missing."""

    name: str
    """The segment, or the file's stem for a single unit."""
    rate_hz: float
    acc_m_s2: Array
    """(T, 3), sensor frame."""
    gyr_rad_s: Array
    """(T, 3), sensor frame."""
    mag_ut: Array | None = None
    """(T, 3), sensor frame; None without a magnetometer."""
    counts: bool = False
    """True: the three arrays hold the converters' raw counts, of which the unit is not known."""
    as_read: NodeRecording | None = None
    """Where a calibration has been applied, the readings before it: only those show the ends of a range."""
    notes: tuple[str, ...] = ()
    """What was repaired in the recording, for a person."""

    @property
    def duration_s(self) -> float:
        """Length of the recording."""
        return len(self.gyr_rad_s) / self.rate_hz


def load_recordings(path: Path) -> dict[str, NodeRecording]:
    """The nodes of a file, by name. Raises RecordingError.

    `.npz` of one unit: `gyr` rad/s, `acc` m/s², (T, 3) each, optionally `mag` µT, and `rate_hz`;
    `mag` alone is enough for hard and soft iron.
    `.npz` of a suit: `t_s`, (T,), and for each segment `{segment}_acc`, `_gyr`, optionally `_mag`.
    `.npz` of a unit in raw counts (as imu_tk's): `acc_raw`, `gyr_raw`, and `t` in seconds.
    `.mcap` of a suit, as `tandem calibrate record` and `live` write it.
    """
    reader = _READERS.get(path.suffix.lower())
    if reader is None:
        known = ", ".join(sorted(_READERS))
        raise RecordingError(f"{path}: cannot read a {path.suffix or 'nameless'} file; expected {known}")
    if not path.is_file():
        raise RecordingError(f"{path}: there is no such file")
    nodes = reader(path)
    for name in nodes:
        if not name or name != Path(name).name or name.startswith("."):
            raise RecordingError(f"{path}: {name!r:.40} cannot be a node's name: a file is to be called so")
    return nodes


def _load_npz(path: Path) -> dict[str, NodeRecording]:
    arrays = read_arrays(path)
    if "acc_raw" in arrays:
        return _raw_unit(path, arrays)
    if "acc" in arrays or "gyr" in arrays or "mag" in arrays:
        return _single_unit(path, arrays)
    return _suit(path, arrays)


def _raw_unit(path: Path, arrays: Arrays) -> dict[str, NodeRecording]:
    acc, gyr = (_vectors(path, arrays, key) for key in ("acc_raw", "gyr_raw"))
    mag = _vectors(path, arrays, "mag_raw") if "mag_raw" in arrays else None
    grid = _grid(path, "t", _need(path, arrays, "t"), len(acc))
    return {path.stem: _node(path, path.stem, grid, (acc, gyr, mag), counts=True)}


def _single_unit(path: Path, arrays: Arrays) -> dict[str, NodeRecording]:
    mag = _vectors(path, arrays, "mag") if "mag" in arrays else None
    if mag is not None and "acc" not in arrays and "gyr" not in arrays:
        return _magnetometer_alone(path, arrays, mag)
    acc, gyr = (_vectors(path, arrays, key) for key in ("acc", "gyr"))
    if "rate_hz" in arrays:
        grid = Grid(_rate(path, arrays["rate_hz"]), np.arange(len(acc), dtype=np.float64), ())
    else:
        time = next((key for key in ("t_s", "t") if key in arrays), None)
        if time is None:
            raise RecordingError(f"{path}: has neither rate_hz nor t_s; add the rate in Hz")
        grid = _grid(path, time, arrays[time], len(acc))
    return {path.stem: _node(path, path.stem, grid, (acc, gyr, mag))}


def _magnetometer_alone(path: Path, arrays: Arrays, mag: Array) -> dict[str, NodeRecording]:
    """Enough for hard and soft iron, which need no times; a rate that is not given is of no account."""
    rate_hz = _rate(path, arrays["rate_hz"]) if "rate_hz" in arrays else _RATE_UNKNOWN_HZ
    none = np.full(mag.shape, np.nan)
    return {path.stem: NodeRecording(path.stem, rate_hz, none, none.copy(), mag)}


def _suit(path: Path, arrays: Arrays) -> dict[str, NodeRecording]:
    names = [key.removesuffix("_gyr") for key in arrays if key.endswith("_gyr")]
    if not names:
        raise RecordingError(
            f"{path}: has no gyroscope; expected gyr and acc of a unit, acc_raw and gyr_raw of a unit, "
            "or {segment}_gyr and {segment}_acc of a suit"
        )
    grid = _grid(path, "t_s", _need(path, arrays, "t_s"))
    nodes = {}
    for name in names:
        acc, gyr = (_vectors(path, arrays, f"{name}_{key}") for key in ("acc", "gyr"))
        mag = _vectors(path, arrays, f"{name}_mag") if f"{name}_mag" in arrays else None
        nodes[name] = _node(path, name, grid, (acc, gyr, mag))
    return nodes


def _node(
    path: Path, name: str, grid: Grid, sensors: tuple[Array, Array, Array | None], *, counts: bool = False
) -> NodeRecording:
    acc, gyr, mag = sensors
    lengths = {len(s) for s in sensors if s is not None} | {len(grid.slots)}
    if len(lengths) != 1:
        raise RecordingError(f"{path}: {name}: its arrays differ in length: {sorted(lengths)}")
    acc, gyr = _laid_out(acc, grid.slots), _laid_out(gyr, grid.slots)
    mag = None if mag is None else _laid_out(mag, grid.slots)
    if mag is not None and np.isnan(mag).all():
        mag = None
    return NodeRecording(name, grid.rate_hz, acc, gyr, mag, counts, notes=grid.notes)


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
    return _plausible(path, float(rate_hz.reshape(())))


def _plausible(path: Path, rate: float) -> float:
    if not _LOWEST_RATE_HZ <= rate <= _HIGHEST_RATE_HZ:
        raise RecordingError(
            f"{path}: a rate of {rate:g} Hz cannot be a node's; expected {_LOWEST_RATE_HZ:g} to "
            f"{_HIGHEST_RATE_HZ:g} Hz (are the times in seconds?)"
        )
    return rate


def _grid(path: Path, key: str, times: NDArray[np.generic], count: int | None = None) -> Grid:
    """The even grid of the samples; refuses what is no even sampling, and cannot be repaired."""
    if times.ndim != 1 or len(times) < 2 or times.dtype.kind not in "fiu":
        raise RecordingError(f"{path}: {key} must be a row of times, one a sample, s")
    if count is not None and len(times) != count:
        raise RecordingError(f"{path}: {key} has {len(times)} times for {count} samples")
    time_s = times.astype(np.float64)
    span_s = float(np.ptp(time_s[np.isfinite(time_s)])) if np.isfinite(time_s).any() else 0.0
    if span_s > 0.0 and not _LOWEST_RATE_HZ <= len(times) / span_s <= 2.0 * _HIGHEST_RATE_HZ:
        _plausible(path, 1.0 / max(float(np.median(np.diff(time_s))), 1e-9))
    grid = lay_out(f"{path}: {key}", time_s)
    _plausible(path, grid.rate_hz)
    return grid


def _laid_out(values: Array, slots: Array) -> Array:
    places = slots.astype(np.intp)
    if places[-1] + 1 == len(places):
        return values
    out = np.full((places[-1] + 1, values.shape[1]), np.nan)
    out[places] = values
    return out


def _load_mcap(path: Path) -> dict[str, NodeRecording]:
    """Every node of a suit that answered at least once, by segment; warns where the file was cut off."""
    from master.suit.recorded import read_sweeps

    sweeps = read_sweeps(path)
    if sweeps.cut:
        log.warning("%s: %s; only its first %.1f s are used", path, sweeps.cut, sweeps.duration_s)
    nodes = {}
    for i, name in enumerate(sweeps.nodes):
        acc, gyr, mag = (sweeps.readings[:, i, k : k + 3].astype(np.float64) for k in (0, 3, 6))
        if np.isnan(gyr).all():
            log.warning("%s: never answered", name)
            continue
        nodes[name] = NodeRecording(name, sweeps.rate_hz, acc, gyr, None if np.isnan(mag).all() else mag)
    if not nodes:
        raise RecordingError(f"{path}: no node answered; check the bus and record again")
    return nodes


Reader = Callable[[Path], dict[str, NodeRecording]]
_READERS: dict[str, Reader] = {".npz": _load_npz, ".mcap": _load_mcap}
