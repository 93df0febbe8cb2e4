"""Missing estimates: how much of a run they are, and with which error they count."""

from __future__ import annotations

import numpy as np

from common.quaternion import Array
from common.wire.messages import Mask
from deploy.measure.trace import Ticks

LEAST_ESTIMATED = 0.95
"""Below this share a value is withheld, because it would leave out the missing part."""
BEGIN_TICKS = 1000
"""5 s at 200 Hz: a joint may settle, or wait for its zero pose, so long without counting as missing."""


def after_beginning(ticks: Ticks, known: Mask) -> Mask:
    """(T, J) True from each joint's first known sample on, `known` (T, J), or from BEGIN_TICKS on."""
    if not len(ticks):
        return known
    begun: Mask = np.logical_or.accumulate(known, axis=0)
    late: Mask = ticks - ticks[0] >= BEGIN_TICKS
    out: Mask = begun | late[:, None]
    return out


def heard_share(ticks: Ticks) -> float:
    """Commands that there are, of those that there should be from the first to the last, by their step."""
    steps = np.diff(np.unique(ticks))
    if not len(steps):
        return 1.0
    expected = round(float(steps.sum()) / max(1.0, float(np.median(steps)))) + 1
    return min(1.0, (len(steps) + 1) / expected)


def charged(true: Array, estimate: Array, asked: Mask) -> Array:
    """Errors (T, J) of estimates, NaN where nothing is `asked`; what is missing counts as if it were held.

    A held estimate is the last known one; its error counts, or the joint's largest where that is larger:
    leaving a sample out must not pay.
    """
    error = np.where(asked, estimate - true, np.nan)
    missing = asked & ~np.isfinite(error)
    if not missing.any():
        return error
    row = np.where(np.isfinite(estimate), np.arange(len(true))[:, None], 0)
    last = np.maximum.accumulate(row, axis=0)
    held = np.take_along_axis(estimate, last, axis=0) - true
    largest = np.max(np.where(np.isfinite(error), np.abs(error), 0.0), axis=0)
    held = np.where(np.isfinite(held), held, largest)
    out: Array = np.where(missing, np.copysign(np.maximum(np.abs(held), largest), held), error)
    return out


def charged_with_largest(error: Array, asked: Mask) -> Array:
    """Errors (T, J), NaN where nothing is `asked`; what is missing counts as the joint's largest."""
    known = np.isfinite(error)
    largest = np.max(np.where(known, np.abs(error), 0.0), axis=0, initial=0.0)
    out: Array = np.where(asked & ~known, largest, np.where(asked, error, np.nan))
    return out
