"""Solved against truth at the same instants: every joint, the paper's Table 1, and its η (Eq. 25).

The paper first shifts its angles by one step of 80 ms, to take out the lag against its reference. Nothing is
shifted here: rows are matched by capture tick, so a lag of the estimate counts as an error.

A missing estimate does not make a value better: an invalid angle counts with the error of the last valid one,
or with the joint's largest error where that is larger. Below LEAST_ESTIMATED a value is withheld.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from common.quaternion import Array
from common.wire.messages import Mask
from deploy.measure.estimated import LEAST_ESTIMATED, after_beginning, charged, heard_share
from deploy.measure.paper import STEP_TICKS, TABLE_1
from deploy.measure.trace import SolvedSeries, Ticks, TruthSeries

SIDES = ("left", "right")
MIN_SAMPLES = 10
"""Fewer matched samples of a joint than these give no figure."""
FAST_SHARE = 0.5
FAST_QUANTILE = 0.95
FAST_FLOOR_DEG = 0.5
"""A step is fast where the truth changes by at least FAST_SHARE of the joint's FAST_QUANTILE step, and by
FAST_FLOOR_DEG (6°/s): the middle half of a reach, and nothing of a joint that only trembles."""
MIN_FAST_STEPS = 2
"""Shorter runs of fast steps are not a period."""


@dataclass(frozen=True, slots=True)
class JointAccuracy:
    """One joint (or all) over the whole run, degrees, solved minus truth."""

    samples: int
    mae_deg: float
    rmse_deg: float
    bias_deg: float
    max_deg: float
    """The largest, without its sign."""


@dataclass(frozen=True, slots=True)
class FastAccuracy:
    """One joint over its fast-moving periods: a row of the paper's Table 1, with the terms of Eq. 25."""

    samples: int
    change_deg: float
    """Mean change of the truth per step."""
    error_deg: float
    """Mean absolute error."""
    rmse_deg: float
    signed_deg: float
    """Eq. 25, numerator: |mean(truth) - mean(solved)| of a period, averaged over periods by their samples."""
    travel_deg: float
    """Eq. 25, denominator: mean of |truth - its first of the period|."""

    @property
    def ratio(self) -> float:
        """Error as a share of the change per step."""
        return self.error_deg / self.change_deg


@dataclass(frozen=True, slots=True)
class Accuracy:
    """How well the joint angles were estimated. A value is None where there was too little data for it.

    It is also None where too small a share was estimated, of it or of one of the joints that it covers.
    """

    joints: Mapping[str, JointAccuracy | None]
    overall: JointAccuracy | None
    fast: Mapping[str, FastAccuracy | None]
    """By full joint name, such as `left_elbow_pitch`: Table 1's five joints on each side the robot has."""
    eta_percent_by_side: Mapping[str, float | None]
    eta_joints: Mapping[str, int]
    """How many of the five joints had a fast period, and so stand in that side's η."""
    estimated: Mapping[str, float] = field(default_factory=dict)
    """By joint, the share of its samples with truth that were estimated, its beginning left out."""
    estimated_fast: Mapping[str, float] = field(default_factory=dict)
    """The same over the fast periods, of the joints that had any."""

    @property
    def withheld(self) -> list[str]:
        """Joints that were estimated for too small a share of the run or of their fast periods."""
        fast = self.estimated_fast
        return [n for n, share in self.estimated.items() if min(share, fast.get(n, 1.0)) < LEAST_ESTIMATED]

    def _fast_rows(self, names: Sequence[str]) -> list[FastAccuracy]:
        """The fast rows of some joints; none where one is withheld, as the rest may look better."""
        if any(self.estimated_fast.get(name, 1.0) < LEAST_ESTIMATED for name in names):
            return []
        return [row for name in names if (row := self.fast.get(name)) is not None]

    @property
    def eta_percent(self) -> float | None:
        """The worse side's η; None where one side's is withheld."""
        if any(share < LEAST_ESTIMATED for share in self.estimated_fast.values()):
            return None
        return max((eta for eta in self.eta_percent_by_side.values() if eta is not None), default=None)

    @property
    def fast_mae_deg(self) -> float | None:
        """Mean absolute error over all fast periods, beside η because η averages signed errors."""
        rows = self._fast_rows(list(self.fast))
        return _mean([row.error_deg for row in rows], [row.samples for row in rows])

    @property
    def fast_rmse_deg(self) -> float | None:
        """Root mean square error over all fast periods."""
        rows = self._fast_rows(list(self.fast))
        square = _mean([row.rmse_deg**2 for row in rows], [row.samples for row in rows])
        return None if square is None else square**0.5

    def worse(self, joint: str) -> FastAccuracy | None:
        """The side with the larger mean error of one of Table 1's joints."""
        rows = self._fast_rows([f"{side}_{joint}" for side in SIDES])
        return max(rows, key=lambda row: row.error_deg, default=None)


def accuracy(truth: TruthSeries, solved: SolvedSeries, joint_names: Sequence[str]) -> Accuracy:
    """Judge the solved angles, row by row of equal tick.

    `joint_names` (J,) are in the order of the columns. Poor data raises nothing: what is unknown is None.
    Until a joint is first valid, for at most BEGIN_TICKS, its filters settle and its zero pose is taken.
    """
    ticks, t_row, s_row = np.intersect1d(truth.tick, solved.tick, return_indices=True)
    true_deg = _degrees(truth.position_rad[t_row], np.ones_like(solved.valid[s_row]))
    solved_deg = _degrees(solved.position_rad[s_row], solved.valid[s_row])
    known = np.isfinite(solved_deg) & np.isfinite(true_deg)
    asked = np.isfinite(true_deg) & after_beginning(ticks, known)
    error_deg = charged(true_deg, solved_deg, asked)
    heard = heard_share(solved.tick)
    shares = [_share(known[:, j], asked[:, j], heard) for j in range(len(joint_names))]
    column = {name: i for i, name in enumerate(joint_names)}
    table_1 = [name for side in SIDES for joint in TABLE_1 if (name := f"{side}_{joint}") in column]
    fast, fast_shares = {}, {}
    for name in table_1:
        j = column[name]
        periods = fast_periods(ticks, true_deg[:, j], asked[:, j])
        if periods:
            rows = np.concatenate([np.arange(p.start, p.stop) for p in periods])
            fast_shares[name] = _share(known[rows, j], asked[rows, j], heard)
        enough = fast_shares.get(name, 0.0) >= LEAST_ESTIMATED and known[:, j].sum() >= MIN_SAMPLES
        fast[name] = _fast(periods, true_deg[:, j], error_deg[:, j]) if enough else None
    judged = [share >= LEAST_ESTIMATED for share in shares]
    by_side = {
        side: [row for joint in TABLE_1 if (row := fast.get(f"{side}_{joint}")) is not None] for side in SIDES
    }
    short = {name.split("_")[0] for name, share in fast_shares.items() if share < LEAST_ESTIMATED}
    return Accuracy(
        joints={
            name: _whole(error_deg[:, i], known[:, i]) if judged[i] else None for name, i in column.items()
        },
        overall=_whole(error_deg.ravel(), known.ravel()) if all(judged) else None,
        fast=fast,
        eta_percent_by_side={
            side: None if side in short else _eta_percent(rows) for side, rows in by_side.items()
        },
        eta_joints={side: len(rows) for side, rows in by_side.items()},
        estimated=dict(zip(joint_names, shares, strict=True)),
        estimated_fast=fast_shares,
    )


def fast_periods(ticks: Ticks, true_deg: Array, usable: Mask) -> list[slice]:
    """Runs of rows over which a joint moves fast (see FAST_SHARE), each at least MIN_FAST_STEPS steps long.

    `ticks`, `true_deg` and `usable` are (T,). A lost command or an unusable row ends a period, because the
    change per step is then not known.
    """
    whole_step = (np.diff(ticks) == STEP_TICKS) & usable[:-1] & usable[1:]
    change_deg = np.where(whole_step, np.abs(np.diff(true_deg)), 0.0)
    if not whole_step.any():
        return []
    quantile_deg = float(np.quantile(change_deg[whole_step], FAST_QUANTILE))
    fast = change_deg >= max(FAST_FLOOR_DEG, FAST_SHARE * quantile_deg)
    edges = np.flatnonzero(np.diff(fast.astype(np.int8), prepend=0, append=0))
    starts, stops = edges[::2], edges[1::2]
    # steps start..stop-1 join rows start..stop
    return [slice(a, b + 1) for a, b in zip(starts, stops, strict=True) if b - a >= MIN_FAST_STEPS]


def _degrees(angle_rad: Array, valid: Mask) -> Array:
    return np.degrees(np.where(valid & np.isfinite(angle_rad), angle_rad, np.nan))


def _share(known: Mask, asked: Mask, heard: float) -> float:
    """Estimated samples as a share of those asked for, lost commands included."""
    return heard * float(np.count_nonzero(known & asked)) / max(1, int(np.count_nonzero(asked)))


def _whole(error_deg: Array, known: Mask) -> JointAccuracy | None:
    samples = int(np.count_nonzero(known))
    error_deg = error_deg[np.isfinite(error_deg)]
    if samples < MIN_SAMPLES:
        return None
    return JointAccuracy(
        samples=samples,
        mae_deg=float(np.mean(np.abs(error_deg))),
        rmse_deg=float(np.sqrt(np.mean(error_deg**2))),
        bias_deg=float(np.mean(error_deg)),
        max_deg=float(np.max(np.abs(error_deg))),
    )


def _fast(periods: Sequence[slice], true_deg: Array, error_deg: Array) -> FastAccuracy:
    errors = np.concatenate([error_deg[p] for p in periods])
    lengths = [len(error_deg[p]) for p in periods]
    # each period by itself: pooled, the error of reaching out would cancel that of drawing back
    signed = [abs(float(np.mean(error_deg[p]))) for p in periods]
    travel = [float(np.mean(np.abs(true_deg[p] - true_deg[p][0]))) for p in periods]
    return FastAccuracy(
        samples=len(errors),
        change_deg=float(np.mean(np.concatenate([np.abs(np.diff(true_deg[p])) for p in periods]))),
        error_deg=float(np.mean(np.abs(errors))),
        rmse_deg=float(np.sqrt(np.mean(errors**2))),
        signed_deg=float(np.average(signed, weights=lengths)),
        travel_deg=float(np.average(travel, weights=lengths)),
    )


def _eta_percent(rows: Sequence[FastAccuracy]) -> float | None:
    """Eq. 25 over the joints of one arm; with one period a joint it is the paper's formula to the letter."""
    if not rows:
        return None
    return 100.0 * sum(row.signed_deg for row in rows) / sum(row.travel_deg for row in rows)


def _mean(values: Sequence[float], weights: Sequence[int]) -> float | None:
    return float(np.average(values, weights=weights)) if values else None
