"""By how much one motion follows another: cross-correlation of two angular speeds. Pure.

Angular speed, the length of a rate vector, is the same however a node sits on its segment, so nothing has to
be calibrated. Two series x and y, each with stamps of its own, are brought onto one grid and smoothed alike;
each window is taken less its mean:

    r(τ) = Σ ⟨x(t), y(t + τ)⟩ / √(Σ ‖x‖² Σ ‖y‖²)

the sums over the windows, so that a window counts by how much moves in it. Where the two motions differ in
shape, as by prediction over a long line, a slow window's delay is another one's.

The delay is where r is largest: the grid's best lag, then the top of the parabola through it and its
neighbours. It is wrong by at most the larger of two bounds, for they fail in different ways:

- by curvature: with a residual of variance σ² and a peak of curvature −c, the top moves by √(σ² / (c N)), N
  the independent samples (Carter, 1987: the Cramér-Rao bound of a delay). It is too small where the two
  motions differ in shape: a servo is no pure delay;
- by repetition: each segment of the run gives a delay of its own; the spread of them bounds their mean.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from common.clock import NS_PER_MS, NS_PER_S, to_ns
from common.quaternion import Array

STEP_NS = 5 * NS_PER_MS
SMOOTH_S = 0.03
"""Standard deviation of the Gaussian that both series are smoothed by: faster is noise, not a person."""
SEARCH_S = (-0.3, 1.5)
SEGMENT_S = 4.0
LEAST_SEGMENTS = 3
LEAST_SPEED = 0.2
"""rad/s, standard deviation: a segment in which less moves says nothing."""
LEAST_CORRELATION = 0.8
AMBIGUOUS = 0.97
"""A second peak of this share of the first, so far away …"""
APART_S = 0.25
"""… makes the delay ambiguous: the motion repeats itself."""
SIGMAS = 3.0
FLOOR_NS = NS_PER_MS // 4
"""No bound is smaller: the stamps of one node are no better."""
GAP_NS = 100 * NS_PER_MS
"""A longer silence of either series is in no segment."""

Nanoseconds = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class AngularSpeed:
    """An angular speed over time."""

    at_ns: Nanoseconds
    """(T,) increasing."""
    rad_s: Array
    """(T,)"""


@dataclass(frozen=True, slots=True)
class MotionDelay:
    """How much later the second series is."""

    delay_ns: int
    bound_ns: int
    """Half-width, by the series alone: what their clocks are uncertain by comes on top."""
    correlation: float
    segments: int


def speed_of(at_ns: Nanoseconds, rotation: Array) -> AngularSpeed:
    """The angular speed of orientations (T, 3, 3), at the middle between each two."""
    order = np.flatnonzero(np.diff(at_ns, prepend=at_ns[0] - 1) > 0)
    at_ns, rotation = at_ns[order], rotation[order]
    # the angle of Rᵀ R': its trace is 1 + 2 cos
    traces = np.einsum("tij,tij->t", rotation[:-1], rotation[1:])
    angle = np.arccos(np.clip((traces - 1.0) / 2.0, -1.0, 1.0))
    step_ns = np.diff(at_ns)
    return AngularSpeed(at_ns[:-1] + step_ns // 2, angle / (step_ns / NS_PER_S))


def find_delay(
    first: AngularSpeed, second: AngularSpeed, search_s: tuple[float, float] = SEARCH_S
) -> MotionDelay | str:
    """By how much `second` follows `first`; or why that cannot be said. Both stamps are of one clock."""
    lags = np.arange(to_ns(search_s[0]) // STEP_NS, to_ns(search_s[1]) // STEP_NS + 1)
    grid = _grid(first, second, lags)
    if grid is None:
        return "the two series do not overlap for long enough"
    x, y, usable = grid
    found = [each for each in _segments(x, y, usable, lags) if each is not None]
    if len(found) < LEAST_SEGMENTS:
        return (
            f"{len(found)} of at least {LEAST_SEGMENTS} segments of {SEGMENT_S:g} s moved enough to be judged"
        )
    whole = _curve(*np.sum(found, axis=0))
    top = _top(whole)
    if top is None:
        return f"the best fit lies at the end of the search, {search_s[0]:g} to {search_s[1]:g} s"
    if whole[round(top)] < LEAST_CORRELATION:
        return f"the two motions are not alike: correlation {whole[round(top)]:.2f} of {LEAST_CORRELATION:g}"
    if _rival(whole, top):
        return "the motion repeats itself, so the delay is ambiguous: move less regularly"
    delay_ns = (lags[0] + top) * STEP_NS
    bound_ns = max(_by_curvature(whole, top, len(found)), _by_repetition(found, lags, top), FLOOR_NS)
    return MotionDelay(round(delay_ns), round(bound_ns), float(whole[round(top)]), len(found))


def _grid(
    first: AngularSpeed, second: AngularSpeed, lags: NDArray[np.int64]
) -> tuple[Array, Array, NDArray[np.bool_]] | None:
    """Both on one grid, and where both were heard; the second reaches beyond the first by the lags."""
    if len(first.at_ns) < 2 or len(second.at_ns) < 2:
        return None
    begin_ns = max(first.at_ns[0], second.at_ns[0] - lags[0] * STEP_NS)
    end_ns = min(first.at_ns[-1], second.at_ns[-1] - lags[-1] * STEP_NS)
    count = int((end_ns - begin_ns) // STEP_NS)
    if count * STEP_NS < LEAST_SEGMENTS * SEGMENT_S * NS_PER_S:
        return None
    at_first = begin_ns + STEP_NS * np.arange(count)
    at_second = begin_ns + STEP_NS * np.arange(lags[0], count + lags[-1])
    x, heard_x = _at(first, at_first)
    y, heard_y = _at(second, at_second)
    return x, y, heard_x & heard_y[-lags[0] : -lags[0] + count]


def _at(speed: AngularSpeed, at_ns: Nanoseconds) -> tuple[Array, NDArray[np.bool_]]:
    """The speed at those times, smoothed; and where it was heard."""
    origin = at_ns[0]
    value = np.interp((at_ns - origin).astype(float), (speed.at_ns - origin).astype(float), speed.rad_s)
    after = np.clip(np.searchsorted(speed.at_ns, at_ns), 1, len(speed.at_ns) - 1)
    heard = speed.at_ns[after] - speed.at_ns[after - 1] <= GAP_NS
    reach = int(np.ceil(4.0 * SMOOTH_S * NS_PER_S / STEP_NS))
    kernel = np.exp(-0.5 * (np.arange(-reach, reach + 1) * STEP_NS / NS_PER_S / SMOOTH_S) ** 2)
    padded = np.pad(value, reach, mode="edge")
    return np.convolve(padded, kernel / kernel.sum(), mode="valid"), heard


def _segments(x: Array, y: Array, usable: NDArray[np.bool_], lags: NDArray[np.int64]) -> list[Array | None]:
    """Each window's sums, or None where it moved too little or was not heard."""
    length = int(SEGMENT_S * NS_PER_S) // STEP_NS
    return [
        _segment(x[at : at + length], y[at : at + length + len(lags) - 1])
        if usable[at : at + length].all()
        else None
        for at in range(0, len(x) - length + 1, length)
    ]


def _segment(x: Array, y: Array) -> Array | None:
    """(3, lags): ⟨x, y⟩, ‖x‖² and ‖y‖² of a window of the first with each window of the second."""
    if x.std() < LEAST_SPEED:
        return None
    windows = np.lib.stride_tricks.sliding_window_view(y, len(x))
    centred = windows - windows.mean(axis=1, keepdims=True)
    own = x - x.mean()
    return np.array(
        [centred @ own, np.full(len(windows), own @ own), np.einsum("lt,lt->l", centred, centred)]
    )


def _curve(products: Array, own: Array, other: Array) -> Array:
    """The correlation at each lag."""
    out: Array = products / np.maximum(np.sqrt(own * other), 1e-12)
    return out


def _top(curve: Array) -> float | None:
    """Where the curve is largest, between its points; None at an end."""
    best = int(np.argmax(curve))
    if best in (0, len(curve) - 1):
        return None
    before, here, after = curve[best - 1 : best + 2]
    return float(best + 0.5 * (before - after) / (before - 2.0 * here + after))


def _rival(curve: Array, top: float) -> bool:
    """Whether another peak is as good."""
    apart = APART_S * NS_PER_S / STEP_NS
    others = np.flatnonzero((curve[1:-1] >= curve[:-2]) & (curve[1:-1] >= curve[2:])) + 1
    far = others[np.abs(others - top) > apart]
    return bool(len(far) and curve[far].max() > AMBIGUOUS * curve[round(top)])


def _by_curvature(curve: Array, top: float, segments: int) -> float:
    best = round(top)
    curvature = -(curve[best - 1] - 2.0 * curve[best] + curve[best + 1]) / STEP_NS**2
    # smoothed samples are independent about each 2 √π σ
    independent = segments * SEGMENT_S / (2.0 * np.sqrt(np.pi) * SMOOTH_S)
    residual = max(1.0 - curve[best] ** 2, 1e-6)
    return float(SIGMAS * np.sqrt(residual / (max(curvature, 1e-30) * independent)))


def _by_repetition(found: list[Array], lags: NDArray[np.int64], top: float) -> float:
    """From the spread of the segments' own delays; each is looked for near the whole's."""
    reach = round(APART_S * NS_PER_S / STEP_NS)
    low, high = max(round(top) - reach, 0), min(round(top) + reach + 1, len(lags))
    tops = [_top(_curve(*each)[low:high]) for each in found]
    own_ns = np.array([np.nan if t is None else (t + low - top) * STEP_NS for t in tops])
    own_ns = own_ns[np.isfinite(own_ns)]
    if len(own_ns) < LEAST_SEGMENTS:
        return float(APART_S * NS_PER_S)
    # Student's t for few segments, as a factor of the standard error
    student = 1.0 + 2.0 / (len(own_ns) - 1)
    return float(SIGMAS * student * own_ns.std(ddof=1) / np.sqrt(len(own_ns)))
