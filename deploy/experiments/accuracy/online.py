"""A filter run over a recording as it would run live: one sample after another, each timed."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from common.quaternion import Array
from deploy.experiments.accuracy.recording import Trial
from deploy.measure.timing import Figures, spread_us
from master.orientation.filter import OrientationFilter

_REPORT_EVERY = 1000


@dataclass(frozen=True, slots=True)
class FilterRun:
    """What one filter made of one recording."""

    q_world_from_sensor: Array
    """(T, 4) right after each sample; what it was where the sample was dropped, NaN before the first."""
    us_per_sample: Figures


def run_online(trial: Trial, filter_: OrientationFilter, advance: Callable[[int], object]) -> FilterRun:
    """Filter a trial by a filter of one node. `advance` hears now and then how many samples went by."""
    gyr, acc, mag = (part[:, None] for part in (trial.gyr_rad_s, trial.acc_m_s2, trial.mag_ut))
    out = np.full((len(gyr), 4), np.nan)
    kept: NDArray[np.intp] = np.flatnonzero(~trial.dropped)
    # after dropped samples the next one has all of the time since the last
    dt_s: list[float | None] = [None if gap == 1 else gap / trial.rate_hz for gap in np.diff(kept).tolist()]
    durations_ns: list[int] = []
    clock = time.perf_counter_ns
    for done, (i, dt) in enumerate(zip(kept.tolist(), [None, *dt_s], strict=True), 1):
        begin_ns = clock()
        filter_.update(gyr[i], acc[i], mag[i], dt)
        q = filter_.q_world_from_sensor()
        durations_ns.append(clock() - begin_ns)
        out[i] = q[0]
        if done % _REPORT_EVERY == 0:
            advance(_REPORT_EVERY)
    advance(len(gyr) - len(kept) + len(kept) % _REPORT_EVERY)
    newest = np.maximum.accumulate(np.where(trial.dropped, -1, np.arange(len(gyr))))
    out[newest >= 0] = out[newest[newest >= 0]]
    return FilterRun(out, spread_us(durations_ns))
