"""A recording of one unit, perhaps with its optical truth, read from npz and checked."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from common.errors import TandemError
from common.quaternion import Array
from common.recording.formats.registry import read_nodes
from common.recording.npz import Arrays, read_arrays
from common.wire.messages import Mask

_NEEDED = ("gyr", "acc", "rate_hz")
_RATE_HZ = (10.0, 10_000.0)
_GRAVITY_M_S2 = (5.0, 20.0)
_FASTEST_RAD_S = 90.0
_LEAST_SAMPLES = 10
_UNIT_TOLERANCE = 0.01


@dataclass(frozen=True, slots=True)
class Trial:
    """T samples of one unit at a fixed rate, sensor frame."""

    name: str
    rate_hz: float
    gyr_rad_s: Array
    """(T, 3); a row of NaN is a sample that was dropped, as in `acc_m_s2`."""
    acc_m_s2: Array
    """(T, 3)."""
    mag_ut: Array
    """(T, 3), any one unit; NaN throughout where the file has none."""
    q_world_from_sensor: Array | None
    """(T, 4) optical truth, NaN where it was hidden; None without `quat`."""
    movement: Mask
    """(T,) the phase that counts; all of it without `movement`."""
    notes: tuple[str, ...] = ()
    """What was assumed about the file or repaired, for a person."""

    @property
    def dropped(self) -> Mask:
        """(T,)."""
        out: Mask = np.isnan(self.gyr_rad_s.sum(axis=1) + self.acc_m_s2.sum(axis=1))
        return out

    def beginning(self, samples: int) -> Trial:
        """The beginning of the recording, with that many kept samples."""
        kept = np.flatnonzero(~self.dropped)[:samples]
        rows = slice(int(kept[0]), int(kept[-1]) + 1)
        truth = self.q_world_from_sensor
        return replace(
            self,
            gyr_rad_s=self.gyr_rad_s[rows],
            acc_m_s2=self.acc_m_s2[rows],
            mag_ut=self.mag_ut[rows],
            q_world_from_sensor=None if truth is None else truth[rows],
            movement=self.movement[rows],
        )

    @property
    def has_magnetometer(self) -> bool:
        """Whether any sample has one."""
        return bool(np.isfinite(self.mag_ut).all(axis=1).any())


def load_trial(path: Path) -> Trial:
    """Read an npz with `gyr acc rate_hz` and, where present, `mag quat movement`; or any other known format.

    Raises TandemError for what cannot be scored, telling what to change.
    """
    if path.suffix.lower() != ".npz" and path.exists():
        return _of_other_format(path)
    arrays = _arrays(path)
    missing = [key for key in _NEEDED if key not in arrays]
    if missing:
        raise _refusal(path, f"has no {' and no '.join(missing)}; it needs gyr, acc, rate_hz and perhaps mag")
    rate_hz = _rate_hz(path, arrays["rate_hz"])
    gyr = _matrix(path, arrays, "gyr", 3)
    count = len(gyr)
    if count < _LEAST_SAMPLES:
        raise _refusal(path, f"has {count} samples: record at least {_LEAST_SAMPLES}")
    acc = _matrix(path, arrays, "acc", 3, count)
    mag = _matrix(path, arrays, "mag", 3, count) if "mag" in arrays else np.full((count, 3), np.nan)
    truth = _matrix(path, arrays, "quat", 4, count) if "quat" in arrays else None
    movement = np.ones(count, dtype=np.bool_)
    if "movement" in arrays:
        if arrays["movement"].shape != (count,):
            raise _refusal(path, f"movement has the shape {arrays['movement'].shape}, not ({count},)")
        if arrays["movement"].dtype.kind not in "biuf":
            raise _refusal(path, f"movement holds {arrays['movement'].dtype}, not true and false")
        movement = np.nan_to_num(arrays["movement"]).astype(np.bool_)
        if not movement.any():
            raise _refusal(path, "movement is false all along: leave it out to score the whole recording")
    trial = Trial(path.stem, rate_hz, gyr, acc, mag, truth, movement)
    _check_units(path, trial)
    _check_truth(path, trial)
    return trial


def _of_other_format(path: Path) -> Trial:
    read = read_nodes([path])
    if len(read.nodes) != 1:
        raise _refusal(
            path,
            f"holds the nodes {', '.join(read.nodes)}: take one (tandem import {path.name} --node NAME)",
        )
    (node,) = read.nodes.values()
    count = len(node.gyr_rad_s)
    if count < _LEAST_SAMPLES:
        raise _refusal(path, f"has {count} samples: record at least {_LEAST_SAMPLES}")
    mag = np.full((count, 3), np.nan) if node.mag_ut is None else node.mag_ut
    movement = np.ones(count, dtype=np.bool_) if node.movement is None else node.movement
    trial = Trial(
        path.stem, node.rate_hz, node.gyr_rad_s, node.acc_m_s2, mag, node.q_world_from_sensor, movement,
        read.notes,
    )  # fmt: skip
    _check_units(path, trial)
    _check_truth(path, trial)
    return trial


def _arrays(path: Path) -> Arrays:
    if not path.exists():
        raise TandemError(f"{path}: there is no such file (and no such command: see tandem accuracy --help)")
    return read_arrays(path)


def _rate_hz(path: Path, value: NDArray[np.generic]) -> float:
    least, most = _RATE_HZ
    if value.size != 1 or value.dtype.kind not in "iuf" or not least <= float(value.item()) <= most:
        raise _refusal(path, f"rate_hz is {value!s:.40}, not one number of {least:g} to {most:g}")
    return float(value.item())


def _matrix(path: Path, arrays: Arrays, key: str, width: int, count: int | None = None) -> Array:
    found = arrays[key]
    if found.ndim != 2 or found.shape[1] != width or (count is not None and len(found) != count):
        rows = "T" if count is None else count
        raise _refusal(path, f"{key} has the shape {found.shape}, not ({rows}, {width})")
    if found.dtype.kind not in "iuf":
        raise _refusal(path, f"{key} holds {found.dtype}, not numbers")
    out = np.ascontiguousarray(found, dtype=np.float64)
    if np.isinf(out).any():
        raise _refusal(path, f"{key} holds infinite values; write dropped samples as NaN")
    return out


def _check_units(path: Path, trial: Trial) -> None:
    kept = ~trial.dropped
    if np.mean(kept) < 0.5:
        raise _refusal(path, "more than half of gyr and acc is NaN: too little to score")
    pull = float(np.median(np.linalg.norm(trial.acc_m_s2[kept], axis=1)))
    least, most = _GRAVITY_M_S2
    if not least <= pull <= most:
        raise _refusal(path, f"the median of ‖acc‖ is {pull:.3g}, not near 9.81: is it in m/s²?")
    fastest = float(np.max(np.linalg.norm(trial.gyr_rad_s[kept], axis=1)))
    if fastest > _FASTEST_RAD_S:
        raise _refusal(path, f"‖gyr‖ reaches {fastest:.3g}: is it in rad/s, not in °/s?")


def _check_truth(path: Path, trial: Trial) -> None:
    if trial.q_world_from_sensor is None:
        return
    known = np.isfinite(trial.q_world_from_sensor).all(axis=1)
    if not (known & trial.movement).any():
        raise _refusal(path, "quat is unknown over the whole movement: leave it out to compare the filters")
    length = np.linalg.norm(trial.q_world_from_sensor[known], axis=1)
    if np.max(np.abs(length - 1.0)) > _UNIT_TOLERANCE:
        raise _refusal(path, "quat is not of unit length (wxyz, sensor to east-north-up)")


def _refusal(path: Path, what: str) -> TandemError:
    return TandemError(f"{path}: {what}")
