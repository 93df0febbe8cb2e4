"""A unit's samples put on one even grid: stamps repaired, sensors of other rates brought onto it."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from common.errors import RecordingError
from common.quaternion import Array
from common.recording.formats.samples import (
    ACC,
    GYR,
    MAG,
    MOVEMENT,
    POSITION,
    QUAT,
    WIDTHS,
    SensorSeries,
    UnitSamples,
)
from common.recording.node import NodeRecording
from common.recording.stamps import Grid, lay_out

_LOWEST_RATE_HZ, _HIGHEST_RATE_HZ = 5.0, 20_000.0
_LEADING = (GYR, ACC, QUAT, POSITION, MAG)
"""The first that a unit has gives the grid."""
_LONGEST_BRIDGED_PERIODS = 3.0
"""An interpolated sensor is drawn straight over no more than so many of its own periods."""


def even_node(path: Path, unit: UnitSamples) -> NodeRecording:
    """The unit on the grid of its gyroscope. Raises RecordingError for what cannot be repaired."""
    leading = next(q for q in _LEADING if q in unit.series)
    lead = unit.series[leading]
    _check_lengths(path, unit, lead)
    origin_s = _origin(unit)
    grid = _grid(path, lead, unit, origin_s)
    notes = list(grid.notes)
    count = int(grid.slots[-1]) + 1
    on_grid: dict[str, Array] = {}
    for quantity, series in unit.series.items():
        if _same_stamps(series, lead):
            on_grid[quantity] = _laid_out(series.values, grid.slots)
        else:
            own = _grid(path, series, unit, origin_s)
            at = grid.start_s + np.arange(count) / grid.rate_hz
            on_grid[quantity] = _interpolated(series.values, own, at, quantity)
            notes += own.notes
            notes.append(
                f"{path}: {unit.name}: {quantity} has stamps of its own ({own.rate_hz:.4g} Hz): interpolated "
                f"at those of {leading} ({grid.rate_hz:.4g} Hz)"
            )
    none = np.full((count, 3), np.nan)
    mag = on_grid.get(MAG)
    movement = on_grid.get(MOVEMENT)
    return NodeRecording(
        unit.name,
        grid.rate_hz,
        on_grid.get(ACC, none),
        on_grid.get(GYR, none.copy()),
        None if mag is None or np.isnan(mag).all() else mag,
        unit.counts,
        notes=tuple(dict.fromkeys(notes)),
        q_world_from_sensor=on_grid.get(QUAT),
        movement=None if movement is None else np.nan_to_num(movement[:, 0]) > 0.0,
        position_m=on_grid.get(POSITION),
        start_s=origin_s + grid.start_s,
        assumed=unit.assumed,
    )


def _check_lengths(path: Path, unit: UnitSamples, lead: SensorSeries) -> None:
    for quantity, series in unit.series.items():
        if series.values.ndim != 2 or series.values.shape[1] != WIDTHS[quantity]:
            raise RecordingError(f"{path}: {unit.name}: {quantity} has the shape {series.values.shape}")
        if series.time_s is not None and len(series.time_s) != len(series.values):
            raise RecordingError(
                f"{path}: {series.stamps} has {len(series.time_s)} times for {len(series.values)} samples"
            )
    lengths = {len(series.values) for series in unit.series.values() if _same_stamps(series, lead)}
    untimed = {len(series.values) for series in unit.series.values() if series.time_s is None}
    if len(lengths | untimed) > 1:
        raise RecordingError(f"{path}: {unit.name}: its arrays differ in length: {sorted(lengths | untimed)}")


def _same_stamps(a: SensorSeries, b: SensorSeries) -> bool:
    if a.time_s is None or b.time_s is None:
        return a.time_s is b.time_s
    return a.time_s is b.time_s or np.array_equal(a.time_s, b.time_s, equal_nan=True)


def _origin(unit: UnitSamples) -> float:
    """The earliest stamp in round seconds, so that seconds since 1970 lose no digits in between."""
    first = [s.time_s[np.isfinite(s.time_s)][:1] for s in unit.series.values() if s.time_s is not None]
    return float(np.floor(min((float(f[0]) for f in first if len(f)), default=0.0)))


def _grid(path: Path, series: SensorSeries, unit: UnitSamples, origin_s: float) -> Grid:
    if series.time_s is None:
        if unit.rate_hz is None:
            raise RecordingError(f"{path}: {unit.name}: has no times; give its rate (--rate HZ)")
        rate_hz = _plausible(path, unit.rate_hz)
        return Grid(rate_hz, np.arange(len(series.values), dtype=np.float64), ())
    time_s = series.time_s - origin_s
    if len(time_s) < 2:
        raise RecordingError(f"{path}: {unit.name}: has {len(time_s)} samples")
    known = np.isfinite(time_s)
    span_s = float(np.ptp(time_s[known])) if known.any() else 0.0
    if span_s > 0.0 and not _LOWEST_RATE_HZ <= len(time_s) / span_s <= 2.0 * _HIGHEST_RATE_HZ:
        _plausible(path, 1.0 / max(float(np.median(np.diff(time_s[known]))), 1e-9))
    grid = lay_out(f"{path}: {series.stamps}", time_s)
    _plausible(path, grid.rate_hz)
    return grid


def _plausible(path: Path, rate_hz: float) -> float:
    if not _LOWEST_RATE_HZ <= rate_hz <= _HIGHEST_RATE_HZ:
        raise RecordingError(
            f"{path}: a rate of {rate_hz:g} Hz cannot be a node's; expected {_LOWEST_RATE_HZ:g} to "
            f"{_HIGHEST_RATE_HZ:g} Hz (are the times in seconds?)"
        )
    return rate_hz


def _laid_out(values: Array, slots: Array) -> Array:
    places = slots.astype(np.intp)
    if places[-1] + 1 == len(places):
        return values
    out = np.full((places[-1] + 1, values.shape[1]), np.nan)
    out[places] = values
    return out


def _interpolated(values: Array, grid: Grid, at_s: Array, quantity: str) -> Array:
    """Values (T, width) on a grid of their own, at other times; NaN beyond both ends and in long gaps."""
    whole = np.isfinite(values).all(axis=1)
    times, rows = grid.start_s + grid.slots[whole] / grid.rate_hz, values[whole]
    out = np.full((len(at_s), values.shape[1]), np.nan)
    if len(rows) < 2:
        return out
    after = np.clip(np.searchsorted(times, at_s, side="right"), 1, len(times) - 1)
    width = times[after] - times[after - 1]
    share = ((at_s - times[after - 1]) / width)[:, None]
    before, behind = rows[after - 1], rows[after]
    if quantity == QUAT:
        # q and -q are one rotation: the nearer one is meant
        behind = behind * np.where(np.sum(before * behind, axis=1, keepdims=True) < 0.0, -1.0, 1.0)
    mixed = (1.0 - share) * before + share * behind
    if quantity == QUAT:
        mixed /= np.linalg.norm(mixed, axis=1, keepdims=True)
    # half a period of the slower one beyond an end is still that end's sample
    near = (share[:, 0] >= -0.5) & (share[:, 0] <= 1.5)
    near &= width <= _LONGEST_BRIDGED_PERIODS / grid.rate_hz
    out[near] = np.where(
        share[near] < 0.0, before[near], np.where(share[near] > 1.0, behind[near], mixed[near])
    )
    return out
