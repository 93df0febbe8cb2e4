"""Moved against truth: the encoders beside the operator's true angles, over the joints that move.

Four figures. Same-instant RMSE: what the patient sees. Motion lag: by how much the robot is late (positive)
or early. Aligned RMSE: what is left when the lag is taken out. Roughness: see `roughness.py`.

A reading that is missing counts as its joint's largest error. Where less than LEAST_ESTIMATED of a moving
joint's readings are valid nothing is judged: the figure of the other joints would be better than it was.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from common.clock import NS_PER_MS, to_ns
from common.quaternion import Array
from common.wire.messages import Mask
from deploy.measure.estimated import LEAST_ESTIMATED, charged_with_largest
from deploy.measure.roughness import accelerations
from deploy.measure.trace import MovedSeries, Nanoseconds, TruthSeries

MOVING_DEG = 5.0
"""A joint that moves less is not judged: its error says nothing about following."""
SETTLE_S = 1.0
"""Left out after each hand-over to `track`, where the last of the alignment still shows."""
GAP_S = 0.1
"""A longer silence of encoders or truth is a gap: it ends a stretch, and nothing is interpolated over it."""
MIN_SAMPLES = 50
"""Fewer usable readings (1 s of them at 50 Hz) give no figure."""
SEARCH_MS = (-100, 500)
"""The range in which the lag is searched."""
_COARSE_MS = 10
_FINE_NS = NS_PER_MS / 10


_Read = tuple[Mapping[str, float], Mask]
"""The share of valid readings by joint, and (T, J) where a reading was asked for."""


@dataclass(frozen=True, slots=True)
class FollowedJoint:
    """One moving joint. The aligned figure uses the lag of the whole robot."""

    rmse_deg: float
    aligned_rmse_deg: float | None
    roughness: float | None


@dataclass(frozen=True, slots=True)
class FollowedMotion:
    """How the robot followed, over all moving joints."""

    joints: Mapping[str, FollowedJoint]
    """The moving joints alone."""
    samples: int
    """Encoder readings judged."""
    rmse_deg: float
    """At the same instants, nothing aligned."""
    lag_ms: float | None
    """Positive: the robot is late. None where the best shift lies outside SEARCH_MS."""
    aligned_rmse_deg: float | None
    roughness: float | None
    """RMS acceleration of the robot over the operator's; None where no stretch is long enough."""
    read: Mapping[str, float]
    """By moving joint, the share of its readings that were valid."""


def motion(truth: TruthSeries, moved: MovedSeries, joint_names: Sequence[str]) -> FollowedMotion | None:
    """Judge the encoders against the truth while the guard was in `track`; None where there is too little.

    `joint_names` (J,) are in the order of the columns; both series must carry stamps of one clock.
    """
    truth, moved = _ordered_truth(truth), _ordered_moved(moved)
    counted = _settled(moved.encoder_ns, moved.tracking)
    if len(truth.tick) < 2 or np.count_nonzero(counted) < MIN_SAMPLES:
        return None
    at_ns = moved.encoder_ns[counted]
    robot_rad = np.where(moved.valid[counted], moved.position_rad[counted], np.nan)
    # one set of samples for every shift, or a shift could win by losing the hard ones
    shifts_ns = np.arange(SEARCH_MS[0], SEARCH_MS[1] + 1, _COARSE_MS) * NS_PER_MS
    asked = np.ones_like(robot_rad, np.bool_)
    for edge_ns in (int(shifts_ns[0]), 0, int(shifts_ns[-1])):
        asked &= np.isfinite(at_shift(truth, at_ns, edge_ns))
    asked &= ~_spans_gap(truth.sampled_ns, at_ns, int(shifts_ns[0]), int(shifts_ns[-1]))[:, None]
    asked[:, ~_moving(at_shift(truth, at_ns, 0), asked)] = False
    columns = np.flatnonzero(np.count_nonzero(asked, axis=0) >= MIN_SAMPLES)
    usable = asked & np.isfinite(robot_rad)
    read = usable[:, columns].sum(axis=0) / asked[:, columns].sum(axis=0)
    if len(columns) == 0 or read.min() < LEAST_ESTIMATED:
        return None
    truth = TruthSeries(truth.tick, truth.sampled_ns, truth.position_rad[:, columns])
    robot_rad = np.where(usable, robot_rad, np.nan)[:, columns]
    rows = asked[:, columns].any(axis=1)
    at_ns, robot_rad, asked = at_ns[rows], robot_rad[rows], asked[rows][:, columns]
    lag_ns = _lag_ns(truth, at_ns, robot_rad, shifts_ns)
    shares = {joint_names[int(c)]: float(share) for c, share in zip(columns, read, strict=True)}
    return _figures(truth, at_ns, robot_rad, lag_ns, (shares, asked))


def at_shift(truth: TruthSeries, at_ns: Nanoseconds, shift_ns: int) -> Array:
    """The truth at `at_ns - shift_ns`, (len(at_ns), J): linear between ticks, NaN outside and over gaps.

    At 200 Hz the linear error of a human reach (50 rad/s²) is below 0.01°.
    """
    when_ns = at_ns - shift_ns
    after = np.clip(np.searchsorted(truth.sampled_ns, when_ns, side="right"), 1, len(truth.sampled_ns) - 1)
    start_ns, stop_ns = truth.sampled_ns[after - 1], truth.sampled_ns[after]
    share = ((when_ns - start_ns) / (stop_ns - start_ns))[:, None]
    out: Array = truth.position_rad[after - 1] * (1.0 - share) + truth.position_rad[after] * share
    known = (when_ns >= start_ns) & (when_ns <= stop_ns) & (stop_ns - start_ns <= to_ns(GAP_S))
    out[~known] = np.nan
    return out


def _figures(
    truth: TruthSeries,
    at_ns: Nanoseconds,
    robot_rad: Array,
    lag_ns: int | None,
    read: _Read,
) -> FollowedMotion:
    shares, asked = read
    now_rad = at_shift(truth, at_ns, 0)
    error = charged_with_largest(np.degrees(robot_rad - now_rad), asked)
    aligned = None
    if lag_ns is not None:
        aligned = charged_with_largest(np.degrees(robot_rad - at_shift(truth, at_ns, lag_ns)), asked)
    robot, operator = accelerations(at_ns, robot_rad, np.where(np.isnan(robot_rad), np.nan, now_rad), GAP_S)
    joints = {
        name: FollowedJoint(
            rmse_deg=_rms(error[:, j]),
            aligned_rmse_deg=None if aligned is None else _rms(aligned[:, j]),
            roughness=_ratio(robot[:, j], operator[:, j]),
        )
        for j, name in enumerate(shares)
    }
    return FollowedMotion(
        joints=joints,
        samples=len(at_ns),
        rmse_deg=_rms(error),
        lag_ms=None if lag_ns is None else lag_ns / NS_PER_MS,
        aligned_rmse_deg=None if aligned is None else _rms(aligned),
        roughness=_ratio(robot, operator),
        read=shares,
    )


def _lag_ns(truth: TruthSeries, at_ns: Nanoseconds, robot_rad: Array, shifts_ns: Nanoseconds) -> int | None:
    """The shift of least RMSE: a coarse scan for the valley, then the least within it."""
    from scipy.optimize import minimize_scalar

    def rmse(shift_ns: float) -> float:
        return _rms(robot_rad - at_shift(truth, at_ns, round(shift_ns)))

    best = int(np.argmin([rmse(s) for s in shifts_ns]))
    if best in (0, len(shifts_ns) - 1):
        return None
    valley = (float(shifts_ns[best - 1]), float(shifts_ns[best + 1]))
    return round(minimize_scalar(rmse, bounds=valley, method="bounded", options={"xatol": _FINE_NS}).x)


def _settled(encoder_ns: Nanoseconds, tracking: Mask) -> Mask:
    """(T,) True from SETTLE_S after each unbroken stretch of tracking began."""
    if len(encoder_ns) == 0:
        return tracking
    begins = tracking & np.r_[True, ~tracking[:-1] | (np.diff(encoder_ns) > to_ns(GAP_S))]
    # the start of the stretch each row lies in, carried forward
    start_ns = np.maximum.accumulate(np.where(begins, encoder_ns, encoder_ns[0]))
    return tracking & (encoder_ns - start_ns >= to_ns(SETTLE_S))


def _spans_gap(sampled_ns: Nanoseconds, at_ns: Nanoseconds, first_ns: int, last_ns: int) -> Mask:
    """(T,) True where some shift between `first_ns` and `last_ns` would land in a gap of the truth."""
    gaps = np.flatnonzero(np.diff(sampled_ns) > to_ns(GAP_S))
    before = np.searchsorted(sampled_ns[gaps + 1], at_ns - last_ns, side="right")
    after = np.searchsorted(sampled_ns[gaps], at_ns - first_ns, side="right")
    return after > before


def _moving(true_rad: Array, usable: Mask) -> Mask:
    """(J,) True where the usable truth ranges over more than MOVING_DEG."""
    low = np.where(usable, true_rad, np.inf).min(axis=0)
    high = np.where(usable, true_rad, -np.inf).max(axis=0)
    return np.asarray(np.degrees(high - low) > MOVING_DEG)


def _ordered_truth(truth: TruthSeries) -> TruthSeries:
    stamps, row = np.unique(truth.sampled_ns, return_index=True)
    # a row that is not whole becomes part of a gap
    whole = np.isfinite(truth.position_rad[row]).all(axis=1)
    row, stamps = row[whole], stamps[whole]
    return TruthSeries(truth.tick[row], stamps, truth.position_rad[row])


def _ordered_moved(moved: MovedSeries) -> MovedSeries:
    stamps, row = np.unique(moved.encoder_ns, return_index=True)
    known = moved.valid[row] & np.isfinite(moved.position_rad[row])
    return MovedSeries(stamps, moved.position_rad[row], known, moved.tracking[row])


def _rms(values: Array) -> float:
    return float(np.sqrt(np.nanmean(values**2)))


def _ratio(robot: Array, operator: Array) -> float | None:
    known = np.isfinite(robot) & np.isfinite(operator)
    if not known.any():
        return None
    below = _rms(operator[known])
    return _rms(robot[known]) / below if below > 0.0 else None
