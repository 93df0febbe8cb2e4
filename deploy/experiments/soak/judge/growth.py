"""What must not grow over hours: latency, memory, descriptors, threads; life by life. Pure."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from common.quaternion import Array
from common.wire.messages import Mask
from deploy.experiments.soak.files.events import of_kind
from deploy.experiments.soak.files.happenings import FaultBegun
from deploy.experiments.soak.judge.evidence import SoakEvidence
from deploy.measure.trend import Slope, in_bins, slope
from deploy.measure.verdict import Outcome, Verdict, at_most

WARM_UP_S = 120.0
"""A process takes what it needs for good in its first minutes; only after that growth means anything."""
SHORTEST_S = 300.0
"""The shortest remainder of the longest life that gives a slope."""
BINS = 400
"""The most bins over a whole soak; a bin holds its median."""
NARROWEST_S = 5.0
RSS_MB_H = 0.5
"""Counts as nothing: 4 MB in 8 h. Resident memory comes in pages and in steps, and what was touched at the
start hides a leak of as much: so what is in use is judged beside it."""
IN_USE_MB_H = 0.25
"""Counts as nothing: 2 MB in 8 h."""
BLOCKS_H = 4000.0
"""Objects of Python: the same, of 64 bytes each."""
PUBLISH = ("master", "slave")
"""Processes that publish what they have in use."""
DRIFT_MS_H = 0.125
"""Counts as nothing: 1 ms in 8 h."""
MOVED_MS_H = 1.0
"""The same of the way to the encoder, of 10 ms and more: it depends on what the operator does."""
ENDS_S = 10.0
"""Over which a life's begin and end are taken."""
MORE = 3.0
"""Descriptors or threads above those after the warm-up: a question under way may hold a few."""


def drift(seen: SoakEvidence) -> list[Verdict]:
    """Latency over time, outside of what is explained; each pair of lives of master and slave by itself."""
    lives = _lives(seen, "master") * 1000 + _lives(seen, "slave")
    return [
        _not_above(seen, f"{name} drifts", column, lives, seen.quiet, limit, "ms/h")
        for name, column, limit in (
            ("one way, median", "one_way_p50_ms", DRIFT_MS_H),
            ("round trip, mean", "round_trip_ms", DRIFT_MS_H),
            ("put → servo written, median", "written_p50_ms", DRIFT_MS_H),
            ("sampled → encoder moved, mean", "end_to_end_ms", MOVED_MS_H),
        )
    ]


def memory(seen: SoakEvidence) -> list[Verdict]:
    """Resident memory of each process: over all that happens, and between the faults alone.

    The first faults of a life touch stacks and code that nothing else does; what grows with time is a leak.
    """
    everything = np.ones(len(seen.samples), np.bool_)
    parts = np.searchsorted([w.from_s for w in seen.explained.faults], seen.samples.at_s).astype(np.float64)
    verdicts = []
    for name in seen.samples.processes:
        column, lives = f"{name}_rss_mb", _lives(seen, name)
        verdicts.append(
            _not_above(seen, f"{name}'s memory grows", column, lives, everything, RSS_MB_H, "MB/h")
        )
        if of_kind(seen.events, FaultBegun):
            words = f"{name} grows between faults"
            verdicts.append(_not_above(seen, words, column, lives, seen.quiet, RSS_MB_H, "MB/h", parts))
    return verdicts


def in_use(seen: SoakEvidence) -> list[Verdict]:
    """Memory that master and slave hold on to: bytes that C allocated, and objects of Python."""
    everything = np.ones(len(seen.samples), np.bool_)
    verdicts = []
    for name in PUBLISH:
        lives = _lives(seen, name)
        for words, column, limit, unit in (
            ("bytes in use", f"{name}_in_use_mb", IN_USE_MB_H, "MB/h"),
            ("objects in use", f"{name}_blocks", BLOCKS_H, "/h"),
        ):
            title = f"{name}'s {words} grow"
            verdicts.append(_not_above(seen, title, column, lives, everything, limit, unit))
    return verdicts


def handles(seen: SoakEvidence) -> list[Verdict]:
    """File descriptors and threads at the end of each life against those after its warm-up."""
    return [
        _more(seen, f"{name}'s {words} grow", f"{name}_{column}", _lives(seen, name))
        for name in seen.samples.processes
        for column, words in (("fds", "descriptors"), ("threads", "threads"))
    ]


def stretches(
    at_s: Array, values: Array, lives: Array, use: Mask, width_s: float, parts: Array | None = None
) -> list[tuple[Array, Array]]:
    """A series (N,) life by life: without each one's warm-up, in bins; times in hours.

    `parts` (N,): numbers of the parts into which a life is split too.
    """
    out = []
    for life in np.unique(lives[np.isfinite(lives)]):
        mine = lives == life
        warm = mine & use & (at_s >= at_s[mine][0] + WARM_UP_S)
        for part in np.unique(parts[warm]) if parts is not None else (None,):
            here = warm if parts is None else warm & (parts == part)
            middles_s, medians = in_bins(at_s[here], values[here], width_s)
            if len(middles_s):
                out.append((middles_s / 3600.0, medians))
    return out


def _lives(seen: SoakEvidence, name: str) -> Array:
    """(N,) number of the life, NaN where it does not run."""
    return seen.samples[f"{name}_life"]


def _slope(
    seen: SoakEvidence, column: str, lives: Array, use: Mask, parts: Array | None = None
) -> tuple[Slope | None, float]:
    """The slope per hour, and how long the longest life was after its warm-up, s; of parts: all together."""
    at_s = seen.samples.at_s
    width_s = max(NARROWEST_S, float(at_s[-1] - at_s[0]) / BINS) if len(at_s) else NARROWEST_S
    series = stretches(at_s, seen.samples[column], lives, use, width_s, parts)
    lengths_s = [3600.0 * float(np.ptp(x)) for x, _ in series]
    judged_s = max(lengths_s, default=0.0) if parts is None else sum(lengths_s)
    return (slope(series) if judged_s >= SHORTEST_S else None), judged_s


def _not_above(
    seen: SoakEvidence,
    name: str,
    column: str,
    lives: Array,
    use: Mask,
    limit: float,
    unit: str,
    parts: Array | None = None,
) -> Verdict:
    found, judged_s = _slope(seen, column, lives, use, parts)
    what = "one life" if parts is None else "all stretches between faults"
    too_short = (
        f"too short: {judged_s:.0f} s of {what} after {WARM_UP_S:.0f} s of warm-up, "
        f"at least {SHORTEST_S:.0f} s are needed"
    )
    return not_above(Verdict(name, Outcome.NOT_JUDGED, None, limit, unit, too_short), found)


def not_above(verdict: Verdict, slope: Slope | None) -> Verdict:
    """Whether a slope is above the verdict's limit, below which growth counts as nothing.

    Passed: with 95 % confidence it is not. Failed: with that confidence it is. Else it is not judged.
    """
    limit = verdict.limit
    if slope is None or limit is None:
        return verdict
    why = f"{slope.low:+.3g} to {slope.high:+.3g} with 95 % confidence, {slope.points} points"
    if slope.low <= limit < slope.high:
        return replace(verdict, measured=slope.value, why=f"too short to judge: {why}")
    outcome = Outcome.PASSED if slope.high <= limit else Outcome.FAILED
    return replace(verdict, outcome=outcome, measured=slope.value, why=why)


def _more(seen: SoakEvidence, name: str, column: str, lives: Array) -> Verdict:
    """The most that any life had more in its end than after its warm-up."""
    at_s, values = seen.samples.at_s, seen.samples[column]
    gains = []
    for life in np.unique(lives[np.isfinite(lives)]):
        mine = (lives == life) & np.isfinite(values)
        if not mine.any():
            continue
        warm_s, last_s = at_s[mine][0] + WARM_UP_S, at_s[mine][-1]
        if last_s - warm_s >= WARM_UP_S:
            first = values[mine & (at_s >= warm_s) & (at_s <= warm_s + ENDS_S)]
            last = values[mine & (at_s >= last_s - ENDS_S)]
            gains.append((float(np.median(last) - np.median(first)), float(np.median(first))))
    if not gains:
        words = f"too short: no life of {2.0 * WARM_UP_S:.0f} s"
        return Verdict(name, Outcome.NOT_JUDGED, limit=MORE, why=words)
    gained, first_had = max(gains)
    return at_most(name, gained, MORE, why=f"from {first_had:.0f}")
