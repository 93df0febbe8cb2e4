"""A recorded person's sensors, played back as the suit's nodes."""

from __future__ import annotations

import logging
from collections.abc import Collection
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from common.errors import ConfigError, ConfigMistake, RecordingError
from common.quaternion import Array
from common.recording.formats.registry import read_nodes
from common.recording.node import NodeRecording
from common.recording.npz import Arrays, read_arrays
from common.recording.together import bridged, together
from common.skeleton import Skeleton
from common.skeleton.full_body import RECORDED_AS
from deploy.sim.suit.sensors import CHANNELS

log = logging.getLogger(__name__)
_LONGEST_BRIDGED_S = 0.25


class Replay:
    """Accelerometer and gyro readings at any time, linear between the recorded samples.

    There is no magnetometer in it and no truth. At its end it is played backwards, then forwards again:
    orientations retrace their way, so there is no seam in them. Backwards in time a rotation rate has the
    opposite sign and an acceleration the same, so the readings stay consistent; only the rate reverses
    suddenly at the two turning points.
    """

    def __init__(self, t_s: Array, acc_m_s2: Array, gyr_rad_s: Array) -> None:
        """Times (T,), rising, and readings (T, N, 3) of the suit's N nodes."""
        self._t_s = t_s - t_s[0]
        self._acc, self._gyr = acc_m_s2, gyr_rad_s
        self.length_s = float(self._t_s[-1])

    def readings(self, t_s: float) -> Array:
        """Readings (N, 9), m/s² · rad/s, at a time since the beginning; the magnetometer's are zero."""
        t = t_s % (2.0 * self.length_s)
        backwards = t > self.length_s
        if backwards:
            t = 2.0 * self.length_s - t
        after = int(np.clip(np.searchsorted(self._t_s, t, side="right"), 1, len(self._t_s) - 1))
        before = after - 1
        share = (t - self._t_s[before]) / (self._t_s[after] - self._t_s[before])
        out = np.zeros((self._acc.shape[1], CHANNELS))
        out[:, 0:3] = (1.0 - share) * self._acc[before] + share * self._acc[after]
        out[:, 3:6] = (1.0 - share) * self._gyr[before] + share * self._gyr[after]
        if backwards:
            out[:, 3:6] *= -1.0
        return out


def load_replay(path: Path, skeleton: Skeleton, nodes: Collection[str]) -> Replay:
    """Read a recording: an npz with `t_s` (T,), `{name}_acc` m/s², `{name}_gyr` rad/s (T, 3) a segment.

    Or a file of any other format that tandem reads, its nodes named as segments are.

    A segment that was not recorded takes its nearest recorded ancestor's readings: a phalanx reads what its
    hand reads, as on a flat, stiff hand.

    `nodes` are the segments that will be asked. Raises ConfigError with the file, the array, what it is and
    what it should be.
    """
    try:
        of_numpy = path.suffix.lower() in (".npz", ".npy") or not path.exists()
        arrays = read_arrays(path) if of_numpy else _nodes(path)
    except RecordingError as error:
        raise _mistake(path, "replay", path.name, f"a readable npz file of plain arrays ({error})") from None
    t_s = _array(path, arrays, "t_s", None)
    if len(t_s) < 2 or not (np.diff(t_s) > 0.0).all():
        raise _mistake(path, "t_s", _shape(t_s), "two or more times, each later than the one before")
    acc = np.zeros((len(t_s), len(skeleton.segments), 3))
    gyr = np.zeros_like(acc)
    for i, segment in enumerate(skeleton.segment_names):
        if segment not in nodes:
            continue
        name = _recorded_name(skeleton, i, arrays)
        if name is None:
            raise _mistake(path, "nodes", segment, f"a segment on or beyond one of {', '.join(RECORDED_AS)}")
        acc[:, i] = _array(path, arrays, f"{name}_acc", len(t_s))
        gyr[:, i] = _array(path, arrays, f"{name}_gyr", len(t_s))
    return Replay(t_s, acc, gyr)


def _nodes(path: Path) -> Arrays:
    """The nodes of another format as such arrays; gaps of a quarter of a second are drawn straight."""
    read = read_nodes([path])
    grid = together(read.nodes)
    arrays: Arrays = {"t_s": grid.time_s}
    for name, node in read.nodes.items():
        longest = round(_LONGEST_BRIDGED_S * node.rate_hz)
        for key, of in (("acc", _acc), ("gyr", _gyr)):
            values = grid.values(name, of)
            if values is not None:
                arrays[f"{name}_{key}"] = bridged(values, longest)
    for note in (*read.notes, *grid.notes):
        log.info("%s", note)
    return arrays


def _acc(node: NodeRecording) -> Array:
    return node.acc_m_s2


def _gyr(node: NodeRecording) -> Array:
    return node.gyr_rad_s


def _recorded_name(skeleton: Skeleton, segment: int, arrays: Arrays) -> str | None:
    """What the recording calls the segment, or else its nearest recorded ancestor."""
    while segment >= 0:
        own = skeleton.segment_names[segment]
        name = own if f"{own}_gyr" in arrays else RECORDED_AS.get(own)
        if name is not None:
            return name
        segment = int(skeleton.parents[segment])
    return None


def _array(path: Path, arrays: Arrays, name: str, samples: int | None) -> Array:
    """One array as float64: (T,) times, or (samples, 3) readings."""
    array = arrays.get(name)
    if array is None:
        there = ", ".join(sorted(arrays)[:6]) or "nothing"
        raise _mistake(path, name, None, f"an array of that name (the file has {there} …)")
    fits = array.ndim == 1 if samples is None else array.shape == (samples, 3)
    if not fits or array.dtype.kind not in "fiu":
        expected = "(T,)" if samples is None else f"({samples}, 3)"
        raise _mistake(path, name, _shape(array), f"numbers of shape {expected}")
    if not np.isfinite(array).all():
        raise _mistake(path, name, "NaN or infinity", "finite numbers only")
    return array.astype(np.float64)


def _shape(array: NDArray[np.generic]) -> str:
    return f"{array.dtype} {array.shape}"


def _mistake(path: Path, key: str, value: object, expected: str) -> ConfigError:
    return ConfigError(path, [ConfigMistake(key, value, expected)])
