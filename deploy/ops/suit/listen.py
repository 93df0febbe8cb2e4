"""Polls the suit for some seconds as the master does, and has each node judged."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict

import numpy as np

from common.errors import TandemError
from common.quaternion import Array
from deploy.calibrate.capture import open_capture
from deploy.ops.suit.examine import NodeFinding, Observed, examine
from master.capture.source import SuitSource
from master.config import MasterConfig
from master.suit.sweep import Sweep

log = logging.getLogger(__name__)


async def listen(config: MasterConfig, seconds: float) -> list[NodeFinding]:
    """Raises BusError where a bus cannot be opened."""
    sweeps: list[Sweep] = []
    capture = open_capture(config, sweeps.append)
    with suppress(TimeoutError):
        async with asyncio.timeout(seconds):
            await capture.run()
    return judge(config, capture.source, sweeps, seconds)


def judge(config: MasterConfig, source: SuitSource, sweeps: list[Sweep], seconds: float) -> list[NodeFinding]:
    """What the sweeps of some seconds say of each node. Raises TandemError where there is none."""
    names = config.skeleton.segment_names
    if not sweeps:
        raise TandemError(f"no tick in {seconds:g} s: this host was stalled; run the check again")
    stalled_s, judged_s = _without_stalls(sweeps, 1.0 / config.capture.rate_hz)
    readings = np.array([np.concatenate([s.acc_m_s2, s.gyr_rad_s, s.mag_ut], axis=1) for s in sweeps])
    fresh = np.array([sweep.fresh for sweep in sweeps])
    answered_ms = np.array([1e-6 * (sweep.frames_in_ns - sweep.sampled_ns) for sweep in sweeps])
    figures, health = source.figures(), source.health
    fused = source.fused
    found = []
    for row, name in enumerate(names):
        if name not in config.nodes:
            continue
        figure = figures.get(row)
        counts = {what: count for what, count in asdict(health[row]).items() if count}
        rate_hz, jitter_ms = _rate(figure, fresh[:, row].sum() / judged_s, answered_ms)
        seen = Observed(
            readings[:, row], fresh[:, row], rate_hz, counts, jitter_ms,
            fused is not None and bool(fused[row]), stalled_s,
        )  # fmt: skip
        found.append(examine(name, seen, 1.0 / config.capture.rate_hz))
    return found


def _without_stalls(sweeps: list[Sweep], tick_s: float) -> tuple[float, float]:
    """Take out the ticks around each stall of this host; for how long it was stalled, and the time left."""
    ticks = np.array([sweep.tick for sweep in sweeps])
    missed = np.diff(ticks) - 1
    after = np.flatnonzero(missed) + 1
    for place in reversed(after.tolist()):
        del sweeps[place]
    stalled_s = float((missed.sum() + len(after)) * tick_s)
    if len(after):
        log.warning("this host missed %d ticks: what was lost then does not count", missed.sum())
    return stalled_s, len(sweeps) * tick_s


def _rate(
    figure: Mapping[str, int] | None,
    answers_hz: float,
    answered_ms: Array,
) -> tuple[float, float | None]:
    """Samples a second and their jitter, by the node's own clock or by its answers."""
    if figure is None:
        return float(answers_hz), float(answered_ms.std())
    return float(figure["rate_hz"]), 1e-3 * figure["jitter_us"]
