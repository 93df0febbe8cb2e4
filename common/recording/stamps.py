"""A recording's stamps put on an even grid, and repaired up to stated limits; what was done is said.

Samples come in order at one rate; their stamps are when somebody looked at a clock. A repeated or wrong
stamp, a burst (a bus adapter that hands over several at once) and jitter move no sample: its place is told by
those before and after it. A gap does: where stamps stay behind for good, samples are missing, and their
places stay empty. A clock that was set back is taken as if it had gone on.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from common.errors import RecordingError
from common.quaternion import Array
from common.wire.messages import Mask

_EVEN = 0.25
"""Steps this near to whole periods need no repair."""
_MOST_WRONG = 0.1
"""Share of stamps that may repeat or go back, beside those that come in bursts."""
_WORST_OFF_S, _WORST_OFF_PERIODS = 0.05, 1.0
"""Root mean square of what stamps are off their places, the larger of both: as of bursts of 170 ms."""
_LARGEST_LOSS = 0.5
"""A recording of which more than this share is missing is not worth laying out on its grid."""
_BESIDE = 32
"""So many stamps either side of a step tell whether samples are missing there."""
_LOST = 0.7
_MOST_SET_BACK = 3
_MOST_SET_FORWARD = 3
_SHORTEST_JUMP_S = 1.0
_FEW = 8
_LENGTHS = (8, 64, 400)
"""Samples over which the period is guessed; each guess is tried."""
_STEADY = 0.05
"""The rate of each quarter of a recording may differ by this share from the whole's."""


@dataclass(frozen=True, slots=True)
class Grid:
    """Where each sample belongs."""

    rate_hz: float
    slots: Array
    """(T,) whole numbers from 0, rising."""
    notes: tuple[str, ...]
    """What was repaired, for a person."""
    start_s: float = 0.0
    """The time of slot 0, by the stamps' own clock."""


def lay_out(where: str, time_s: Array) -> Grid:
    """The grid of stamps (T,), s; NaN where one is missing. Raises RecordingError, beginning with `where`."""
    known = np.isfinite(time_s)
    if known.mean() < 1.0 - _MOST_WRONG:
        raise RecordingError(f"{where} must be a row of finite times, one a sample")
    place = np.arange(len(time_s), dtype=np.float64)
    time = np.interp(place, place[known], time_s[known])
    time, jumps = _clock_set_forward(time)
    steps = np.diff(time)
    notes: tuple[str, ...]
    exact = _even(steps)
    if exact is not None and known.all():
        slots = np.concatenate([[0.0], np.cumsum(exact)])
        rate, notes = float(slots[-1] / (time[-1] - time[0])), ()
        _check_loss(where, slots)
    else:
        if np.mean(steps < 0.0) > 2.0 * _MOST_WRONG:
            raise RecordingError(f"{where} does not rise from sample to sample; record again")
        time, set_back = _clock_set_back(time)
        slots = _best_places(where, time)
        _check_loss(where, slots)
        rate, off = _line(slots, time)
        _check_even(where, slots, time, off)
        notes = (_note(where, steps, rate, off, (int((~known).sum()), set_back)),)
    missing = int(slots[-1]) + 1 - len(slots)
    if missing:
        notes = (*notes, f"{where}: {missing} samples are missing by the times; their places stay empty")
    notes = (*(f"{where}: {jump}" for jump in jumps), *notes)
    return Grid(rate, slots, notes, float(np.median(time - slots / rate)))


def _clock_set_forward(time: Array) -> tuple[Array, list[str]]:
    """The stamps as if a clock that was set forward for good had gone on, and what was done, in words.

    Only a step as long as all the rest is taken so: as a gap, it would cost the whole recording.
    """
    out, said = time.copy(), []
    period = float(np.median(np.abs(np.diff(time))))
    for _ in range(_MOST_SET_FORWARD):
        steps = np.diff(out)
        k = int(np.argmax(steps))
        step = float(steps[k])
        near = min(_BESIDE, k + 1, len(out) - k - 1)
        lasting = float(np.median(out[k + 1 : k + 1 + near]) - np.median(out[k + 1 - near : k + 1]))
        if step < _SHORTEST_JUMP_S or min(step, lasting) < 0.5 * float(out[-1] - out[0]):
            break
        out[k + 1 :] -= step - period
        said.append(
            f"the time jumps by {step:.6g} s after sample {k + 1}: taken as a clock that was set; if it was "
            "a pause, cut the file there"
        )
    return out, said


def _even(steps: Array) -> Array | None:
    """How many periods each step is, (T-1,), where all of them are plainly so."""
    period = float(np.median(steps))
    if not period > 0.0:
        return None
    whole = np.rint(steps / period)
    near = np.quantile(np.abs(steps / period - whole), 0.99) <= _EVEN and np.all(whole >= 1.0)
    return whole if near else None


def _clock_set_back(time: Array) -> tuple[Array, int]:
    """The stamps as if a clock that was set back for good had gone on, and how often it was."""
    out, times = time.copy(), 0
    period = float(np.median(np.abs(np.diff(time))))
    for k in (np.flatnonzero(np.diff(time) < 0.0) + 1).tolist():
        near = min(_BESIDE, k, len(time) - k)
        step = float(np.median(out[k : k + near]) - np.median(out[k - near : k])) - near * period
        if step < -max(2.0 * _WORST_OFF_S, 0.5 * near * period) and times < _MOST_SET_BACK:
            out[k:] -= step
            times += 1
    return out, times


def _best_places(where: str, time: Array) -> Array:
    """Slots (T,), of several guesses of the period those on which the stamps lie best."""
    guesses = [float(time[-1] - time[0]) / (len(time) - 1)]
    for length in _LENGTHS:
        if 2 * length < len(time):
            guesses.append(float(np.median(time[length:] - time[:-length])) / length)
    found: list[tuple[float, Array]] = []
    for guess in guesses:
        if not guess > 0.0:
            continue
        slots = _places(time, guess)
        rate, _ = _line(slots, time)
        slots = _places(time, 1.0 / rate)
        rate, off = _line(slots, time)
        missing = (slots[-1] + 1.0 - len(slots)) / len(slots)
        found.append((float(np.median(np.abs(off))) * rate + float(missing), slots))
    if not found:
        raise RecordingError(f"{where} does not rise from sample to sample; record again")
    return min(found, key=lambda one: one[0])[1]


def _places(time: Array, period: float) -> Array:
    """Slots (T,) of stamps that jitter: a step is a gap where the stamps behind it stay later for good."""
    count = len(time)
    place = np.arange(count, dtype=np.float64)
    ahead = time / period - place
    lost = np.zeros(count)
    total = 0.0
    for k in _suspects(ahead, np.diff(time) > _LOST * period):
        earlier = ahead[max(0, k - _BESIDE) : k] - lost[max(0, k - _BESIDE) : k]
        before, spread = float(np.median(earlier)), float(np.ptp(earlier))
        later = float(np.median(ahead[k : k + _BESIDE])) - total - before
        # what a clock drifts meanwhile, or a burst moves, is less than a period; what is missing is not
        least = _LOST if len(earlier) >= _FEW else 1.5
        if later > max(least, 0.3 * spread) and ahead[k] - total - before > 0.5:
            total += float(round(later))
        lost[k:] = total
    out: Array = place + lost
    return out


def _suspects(ahead: Array, long_step: Mask) -> NDArray[np.intp]:
    """Samples after a long step (T-1,) behind which the next are on average later than those before."""
    total = np.concatenate([[0.0], np.cumsum(ahead)])
    k = np.flatnonzero(long_step) + 1
    first, last = np.maximum(k - _BESIDE, 0), np.minimum(k + _BESIDE, len(ahead))
    later = (total[last] - total[k]) / (last - k) - (total[k] - total[first]) / (k - first)
    out: NDArray[np.intp] = k[later > 0.3]
    return out


def _line(slots: Array, time: Array) -> tuple[float, Array]:
    """The rate, Hz, and how far stamps are off their places, (T,) s; a clock that drifts is followed."""
    trusted = np.ones(len(time), dtype=np.bool_)
    slope, start = 0.0, 0.0
    for _ in range(3):
        slope, start = np.polyfit(slots[trusted], time[trusted], 1)
        off = time - (start + slope * slots)
        trusted = np.abs(off) <= max(5.0 * float(np.median(np.abs(off))), 1e-9)
    count = max(2, min(50, len(time) // 200))
    parts: list[int] = np.linspace(0, len(time), count + 1).astype(int).tolist()
    drift = np.interp(
        slots,
        [float(slots[a:b].mean()) for a, b in pairwise(parts)],
        [float(np.median(off[a:b])) for a, b in pairwise(parts)],
    )
    return 1.0 / max(float(slope), 1e-12), off - drift


def _check_loss(where: str, slots: Array) -> None:
    if len(slots) < _LARGEST_LOSS * (slots[-1] + 1.0):
        raise RecordingError(f"{where}: more than half of the samples are missing; record again")


def _check_even(where: str, slots: Array, time: Array, off: Array) -> None:
    rate_hz = 1.0 / max(_slope(slots, time), 1e-12)
    most = max(_WORST_OFF_S, _WORST_OFF_PERIODS / rate_hz)
    quarters = np.array_split(np.arange(len(time)), 4)
    rates = [1.0 / max(_slope(slots[q], time[q]), 1e-12) for q in quarters if len(q) > 10]
    steady = all(abs(rate / rate_hz - 1.0) < _STEADY for rate in rates)
    # a few stamps may be anywhere; the rest may not
    usual = np.sort(np.abs(off))[: max(1, round((1.0 - _MOST_WRONG) * len(off)))]
    rms = float(np.sqrt(np.mean(usual**2)))
    if rms > most or not steady:
        steps = np.diff(time)
        raise RecordingError(
            f"{where} is not evenly spaced: steps of {1e3 * steps.min():.3g} to {1e3 * steps.max():.3g} ms"
            f", {1e3 * rms:.3g} ms off an even grid, at most {1e3 * most:.3g} ms can be repaired; "
            "record at one rate"
        )


def _slope(slots: Array, time: Array) -> float:
    """Seconds a slot, by the medians of both ends."""
    tenth = max(1, len(time) // 5)
    rise = float(np.median(time[-tenth:]) - np.median(time[:tenth]))
    return rise / max(float(np.median(slots[-tenth:]) - np.median(slots[:tenth])), 1e-9)


def _note(where: str, steps: Array, rate_hz: float, off: Array, others: tuple[int, int]) -> str:
    without, set_back = others
    repeated, back = int(np.sum(steps == 0.0)), int(np.sum(steps < 0.0))
    words = []
    if without:
        words.append(f"{without} without a number")
    if repeated + back > _MOST_WRONG * len(steps):
        words.append(f"{int(np.sum(steps > 1.5 / rate_hz))} bursts")
    if repeated:
        words.append(f"{repeated} repeated")
    if back:
        words.append(f"{back} going back")
    if set_back:
        words.append(f"the clock set back {set_back} times")
    jitter = 1.4826 * float(np.median(np.abs(off))) * rate_hz
    if jitter > 0.05:
        words.append(f"jitter of {100 * jitter:.0f} % of a period")
    what = ", ".join(words) or "single stamps off"
    return f"{where}: stamps repaired by their order ({what}); the samples stay as they are"
