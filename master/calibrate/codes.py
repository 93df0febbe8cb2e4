"""A magnetometer's readings that are none: overflow codes, zeros, spikes, and values that were only repeated.

Converters say "out of range" by a number: -4096 (HMC5883), the end of 16 bits, whatever the driver scales
these to. A driver that missed a reading often gives zeros, or the last one again. What was declared is
dropped; so is what shows by its look, and all of it is counted.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from common.errors import RecordingError
from common.quaternion import Array
from common.wire.messages import Mask

_FAR = 3.0
"""Half ranges from the middle: what lies further off is no reading of the same field."""
_MOST_DROPPED = 0.1
_FEWEST_ALIKE, _SHARE_ALIKE = 5, 0.001
"""So many times at least must a value come on an axis to look like a code."""
_CROWDED = 8.0
"""And so many times as often as its neighbours on the axis, the ten nearest values either side."""
_JUMP = 0.05
"""Of the axis' range: a code comes and goes by such a step."""
_HELD_SHARE = 0.4
_AXES = "xyz"


@dataclass(frozen=True, slots=True)
class Cleaned:
    """Readings without what is none."""

    readings: Array
    """(T, 3), NaN where there is none."""
    expected: int
    """How many readings a sensor of this rate gives in that time."""
    notes: tuple[str, ...]
    """What was dropped, and how often."""

    @property
    def missing(self) -> float:
        """Share of what was expected, 0 to 1."""
        return max(0.0, 1.0 - int(np.isfinite(self.readings).all(axis=1).sum()) / max(1, self.expected))


def clean(readings: Array, declared: Sequence[float] = ()) -> Cleaned:
    """Drop from readings (T, 3) what is declared to be a code, and what looks like one.

    Raises RecordingError where that is more than a sound sensor's share.
    """
    out = np.where(np.isfinite(readings).all(axis=1, keepdims=True), readings, np.nan)
    came = int(np.isfinite(out[:, 0]).sum())
    expected, notes = _own_rate(out)
    dropped = 0
    finders: tuple[tuple[str, Callable[[Array], Mask]], ...] = (
        ("overflow codes as declared", lambda m: _any(np.isin(m, np.asarray(declared, dtype=float)))),
        ("readings of zero on all axes", lambda m: np.logical_not(_any(m != 0.0))),
        ("overflow codes or spikes far out of the field's range", _far),
        ("values that come too often to be readings", _codes),
    )
    for word, find in finders:
        bad: Mask = np.logical_and(find(out), np.isfinite(out[:, 0]))
        count = int(bad.sum())
        if count:
            values = ""
            if "declared" in word:
                values = f" ({', '.join(f'{code:g}' for code in declared)})"
            elif "overflow" in word:
                values = f" ({_examples(out[bad])})"
            share = f"{100 * count / came:.2g} % of the magnetometer's"
            notes.append(f"{count} {word}{values} dropped, {share}")
            out[bad] = np.nan
            dropped += count
    if dropped > _MOST_DROPPED * came:
        which = "; ".join(notes)
        raise RecordingError(
            f"{100 * dropped / came:.0f} % of the magnetometer's readings are none: {which}. "
            "Set a larger range or look at its driver, and record again"
        )
    return Cleaned(out, expected, tuple(notes))


def _own_rate(out: Array) -> tuple[int, list[str]]:
    """How many readings to expect; values that are only held are taken out, in place."""
    known = np.isfinite(out[:, 0])
    place = np.flatnonzero(known)
    if len(place) < 3:
        return len(out), []
    rows = out[place]
    same = np.concatenate([[False], np.all(rows[1:] == rows[:-1], axis=1)])
    word = ""
    if np.mean(same) > _HELD_SHARE and _even(np.flatnonzero(~same)):
        out[place[same]] = np.nan
        place, word = place[~same], ", each held until the next"
    step = float(np.median(np.diff(place)))
    if step < 2.0 or not _even(place):
        return len(out), []
    every = float(np.mean(np.diff(place)[np.diff(place) <= step + 1.0]))
    return round(len(out) / every), [f"the magnetometer gives a reading every {every:.3g} samples{word}"]


def _any(flags: Mask) -> Mask:
    out: Mask = np.any(flags, axis=1)
    return out


def _even(place: NDArray[np.intp]) -> bool:
    steps = np.diff(place)
    return len(steps) > 0 and float(np.mean(np.abs(steps - np.median(steps)) <= 1.0)) > 0.9


def _far(m: Array) -> Mask:
    """(T,) further from the middle of any axis than the field can reach."""
    known = np.isfinite(m[:, 0])
    low, high = np.quantile(m[known], [0.05, 0.95], axis=0)
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    # one axis may have moved little; the field is as strong along it as along the others
    reach = np.maximum(half, 0.5 * half.max())
    out: Mask = np.any(np.abs(m - middle) > _FAR * np.maximum(reach, 1e-12), axis=1)
    return out


def _codes(m: Array) -> Mask:
    """(T,) with a value on an axis that comes far more often than those next to it, and jumps there."""
    bad = np.zeros(len(m), dtype=np.bool_)
    known = np.flatnonzero(np.isfinite(m[:, 0]))
    for column in m[known].T:
        values, counts = np.unique(column, return_counts=True)
        fewest = max(_FEWEST_ALIKE, _SHARE_ALIKE * len(column))
        span = float(np.quantile(column, 0.99) - np.quantile(column, 0.01))
        for n in np.flatnonzero(counts >= fewest):
            around = np.concatenate([counts[max(0, n - 10) : n], counts[n + 1 : n + 11]])
            if not len(around) or counts[n] < _CROWDED * float(np.median(around)):
                continue
            at = column == values[n]
            edges = np.flatnonzero(at[1:] != at[:-1])
            steps = np.abs(column[edges + 1] - column[edges])
            if len(steps) and float(np.median(steps)) > _JUMP * span:
                bad[known[at]] = True
    return bad


def _examples(rows: Array) -> str:
    """The most extreme values, a few of them."""
    values, counts = np.unique(
        rows[np.arange(len(rows)), np.argmax(np.abs(rows), axis=1)], return_counts=True
    )
    most = values[np.argsort(-counts)][:2]
    return ", ".join(f"{value:.6g}" for value in most) + (", …" if len(values) > 2 else "")
