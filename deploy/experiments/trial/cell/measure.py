"""A cell's figures from what was heard of it. Pure.

Commands, states and truth are matched by their own numbers and stamps: a command was accepted where a state
echoes it. Percentiles are those of single commands, never of other percentiles.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from common.clock import NS_PER_MS, NS_PER_S, to_ns
from common.metrics.master import MasterMetrics
from common.metrics.slave import SlaveMetrics
from common.wire.messages import RobotState
from deploy.experiments.trial.cell.aftermath import aftermath
from deploy.experiments.trial.cell.figures import BY_NAME
from deploy.experiments.trial.cell.recording import (
    CellCourse,
    CellMessages,
    counts,
    echoes,
    latest_bound_ns,
    published,
)
from deploy.experiments.trial.cell.result import Excerpt
from deploy.measure import MovedSeries, TruthSeries, accuracy, motion
from deploy.measure.blind import blind_figures, blind_outages
from deploy.measure.motion import at_shift
from deploy.measure.replay import arrivals, compare
from slave.config import SlaveConfig

EXCERPT_S = 6.0


def measure(course: CellCourse, config: SlaveConfig) -> dict[str, float | None]:
    """Every figure; None for what this cell could not measure."""
    judged = course.judged
    figures: dict[str, float | None] = dict.fromkeys(BY_NAME)
    figures |= _latency(judged, course.shared_clock)
    figures |= _motion(judged, config)
    figures |= _guard(judged)
    if course.after is not None and course.outage is not None:
        figures |= aftermath(course.after, course.outage, course.max_age_s)
        figures |= _blind([*judged.states, *course.after.states], config)
    figures |= {
        f"cpu_{name}": value for name, value in course.cpu_percent.items() if f"cpu_{name}" in BY_NAME
    }
    figures["up_kb_s"] = _kilo(course.up_bytes_s)
    figures["down_kb_s"] = _kilo(course.down_bytes_s)
    figures["ticks_missed"] = _missed_percent(judged)
    return figures


def _blind(states: Sequence[RobotState], config: SlaveConfig) -> dict[str, float | None]:
    """How far hands went without commands, against what was foretold: every hold and the outage."""
    each = {state.sequence: state for state in states}
    found = blind_figures(blind_outages([each[n] for n in sorted(each)], config.skeleton))
    return {
        "blind_farthest_cm": found.farthest_cm,
        "blind_share": found.share,
        "blind_excess_cm": found.excess_cm,
    }


def one_way_percentiles_ms(judged: CellMessages) -> list[float]:
    """The percentiles 0, 1 … 100 of accepted commands by their stamps; [] where there is none."""
    transits = _transits_ms(judged)
    return np.percentile(transits, np.arange(101)).tolist() if transits else []


def excerpt(judged: CellMessages, config: SlaveConfig) -> Excerpt | None:
    """The last seconds in track of the joint that the operator moved furthest."""
    trace = judged.trace(config.skeleton)
    truth, moved = trace.truth(), trace.moved()
    if not moved.tracking.any() or len(truth.tick) < 2:
        return None
    last_ns = int(moved.encoder_ns[moved.tracking][-1])
    rows = moved.tracking & (moved.encoder_ns > last_ns - to_ns(EXCERPT_S)) & (moved.encoder_ns <= last_ns)
    operator = np.degrees(at_shift(truth, moved.encoder_ns[rows], 0))
    joint = int(np.argmax(np.ptp(truth.position_rad, axis=0)))
    known = np.isfinite(operator[:, joint])
    if not known.any():
        return None
    at_ns = moved.encoder_ns[rows][known]
    return Excerpt(
        joint=trace.joint_names[joint],
        at_s=((at_ns - at_ns[0]) / NS_PER_S).tolist(),
        operator_deg=operator[known, joint].tolist(),
        robot_deg=np.degrees(moved.position_rad[rows][known, joint]).tolist(),
    )


def _latency(judged: CellMessages, shared_clock: bool) -> dict[str, float | None]:
    sampled_ns = {c.sequence: c.stamps.sampled_ns for c in judged.commands}
    ages = [
        (e.written_ns - sampled_ns[n]) / NS_PER_MS
        for n, e in echoes(judged.states).items()
        if e.written_ns and n in sampled_ns
    ]
    bound_ns = latest_bound_ns(judged.states)
    return {
        **_percentiles("one_way", _one_way_ms(judged)),
        "one_way_corrected_p99_ms": _percentiles("all", _one_way_ms(judged, missing=True)).get("all_p99_ms"),
        "one_way_bound_ms": None if bound_ns is None else bound_ns / NS_PER_MS,
        **_percentiles("round_trip", _round_trip_ms(judged)),
        **_percentiles("age", ages),
        **(_percentiles("true_one_way", _transits_ms(judged)) if shared_clock else {}),
        "delivered": _delivered_percent(judged),
        "accepted": _accepted_percent(judged),
    }


def _one_way_ms(judged: CellMessages, missing: bool = False) -> list[float]:
    """Each one-way time that the slave published between its first message and its last.

    With the `missing`, also what it took for each command that was due and did not come.
    """
    all_ = [word.metrics for word in published(judged.statistics, SlaveMetrics)[1:]]
    came = [us / 1000.0 for metrics in all_ for us in metrics.one_way_recent_us]
    if not missing:
        return came
    return came + [us / 1000.0 for metrics in all_ for us in metrics.one_way_missing_recent_us]


def _round_trip_ms(judged: CellMessages) -> list[float]:
    """Each round trip that the master published between its first message and its last."""
    words = published(judged.statistics, MasterMetrics)[1:]
    robots = [robot for word in words for robot in word.metrics.robots.values()]
    return [us / 1000.0 for robot in robots for us in robot.round_trip_recent_us]


def _transits_ms(judged: CellMessages) -> list[float]:
    sent = {c.sequence for c in judged.commands}
    found = echoes(judged.states).items()
    return [(e.received_ns - e.put_ns) / NS_PER_MS for n, e in found if n in sent]


def _percentiles(name: str, values_ms: Sequence[float]) -> dict[str, float | None]:
    if not values_ms:
        return {}
    p50, p99 = np.percentile(values_ms, (50, 99)).tolist()
    return {f"{name}_p50_ms": p50, f"{name}_p99_ms": p99}


def _accepted_percent(judged: CellMessages) -> float | None:
    """Of the commands sent up to the newest echo: those after it may still be on their way."""
    found = echoes(judged.states)
    numbers = [c.sequence for c in judged.commands]
    if not numbers:
        return None
    newest = max((n for n in found if n in set(numbers)), default=None)
    if newest is None:
        return 0.0
    sent = newest - min(numbers) + 1
    return 100.0 * sum(min(numbers) <= n <= newest for n in found) / sent


def _delivered_percent(judged: CellMessages) -> float | None:
    """Between the slave's first and last word: what came, of what was due by numbers and by time."""
    published_metrics = published(judged.statistics, SlaveMetrics)
    if len(published_metrics) < 2:
        return None
    first, last = (published_metrics[i].metrics.commands for i in (0, -1))
    due = published_metrics[-1].metrics.due.expected - published_metrics[0].metrics.due.expected
    came = (last.arrived - first.arrived) - (last.repeated - first.repeated)
    # one that was missing before the first word and came after it makes `lost` shrink
    sent = max(came + max(0, last.lost - first.lost), due - (last.repeated - first.repeated))
    return 100.0 * came / sent if sent else None


def _motion(judged: CellMessages, config: SlaveConfig) -> dict[str, float | None]:
    trace = judged.trace(config.skeleton)
    truth, moved = trace.truth(), trace.moved()
    followed = motion(truth, moved, trace.joint_names)
    solved = accuracy(truth, trace.solved(), trace.joint_names)
    figures: dict[str, float | None] = {
        "eta_percent": solved.eta_percent,
        "estimated": 100.0 * min(solved.estimated.values()) if len(truth.tick) else None,
    }
    if followed is None:
        return figures
    return figures | {
        "rmse_deg": followed.rmse_deg,
        "rmse_over_latest": _over_latest(judged, truth, moved, config),
        "lag_ms": followed.lag_ms,
        "aligned_rmse_deg": followed.aligned_rmse_deg,
        "roughness": followed.roughness,
    }


def _over_latest(
    judged: CellMessages, truth: TruthSeries, moved: MovedSeries, config: SlaveConfig
) -> float | None:
    compared = compare(truth, moved, arrivals(judged.commands, judged.states), config, ["latest"])
    return None if compared is None else compared.rmse_over_latest


def _guard(judged: CellMessages) -> dict[str, float | None]:
    states = judged.states
    if not states:
        return {}
    left = sum(before.guard == "track" != after.guard for before, after in pairwise(states))
    # a kind that is absent did not grow; with fewer than two messages the growth is unknown
    has_metrics = len(published(judged.statistics, SlaveMetrics)) > 1
    counted = counts(judged)
    return {
        "tracked": 100.0 * sum(s.guard == "track" for s in states) / len(states),
        "holds": float(left),
        "refused": float(sum(counted.get("dropped", {}).values())) if has_metrics else None,
        "clamps": float(sum(counted.get("clamps", {}).values())) if has_metrics else None,
    }


def _missed_percent(judged: CellMessages) -> float | None:
    shares = []
    ticks_of_processes = (
        [word.metrics.ticks for word in published(judged.statistics, MasterMetrics)],
        [word.metrics.ticks for word in published(judged.statistics, SlaveMetrics)],
    )
    for ticks in ticks_of_processes:
        if len(ticks) < 2:
            continue
        first, last = ticks[0], ticks[-1]
        if last.expected > first.expected:
            shares.append(100.0 * (last.missed - first.missed) / (last.expected - first.expected))
    return max(shares, default=None)


def _kilo(value: float | None) -> float | None:
    return None if value is None else value / 1000.0
