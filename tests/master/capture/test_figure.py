"""Free-running nodes against the same nodes on SYNC: 36 at 100 to 400 Hz, own clocks, 1 % lost."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from common.clock import to_ns
from common.quaternion import Array, angle_between
from deploy.sim.suit.free_running import FreeNode, NodeClock, Reading, sent_by
from master.capture.layout import MappedLayout
from master.capture.mixed import MixedSuit
from master.orientation.config import EstimationConfig
from master.orientation.estimator import Estimator
from master.suit.nodes import NodeConfig
from master.suit.protocol import SuitProtocol
from master.suit.sweep import Sweep

PERIOD_S = 0.005
REST_S = 4.0


class FreeRun:
    """Nodes of one layout on buses of their own, and the suit that hears them, tick by tick."""

    def __init__(
        self,
        layout: MappedLayout,
        readings: list[Reading],
        rates_hz: list[float],
        throttled_hz: float = 0.0,
        throttled_s: float = np.inf,
    ) -> None:
        random = np.random.default_rng(5)
        count = len(readings)
        self.configs = [NodeConfig(id=1, bus=f"b{k}", layout=layout.name) for k in range(count)]
        fd = {node.bus: False for node in self.configs}
        self.suit = MixedSuit(self.configs, SuitProtocol.load(), {layout.name: layout}, 20, fd)
        self.nodes = {}
        for place, (reading, rate_hz) in enumerate(zip(readings, rates_hz, strict=True)):
            phase_s, drift_ppm, begins_s = random.uniform([0.0, -100.0, 0.0], [0.01, 100.0, 9.0])
            clock = NodeClock(rate_hz, phase_s, drift_ppm, begins_s, throttled_hz, throttled_s)
            self.nodes[f"b{place}"] = [FreeNode(layout, 1, reading, clock)]
        self.random = random

    def sweeps(self, seconds: float, lost_share: float) -> list[Sweep]:
        sent = sent_by(self.nodes, seconds, self.random, lost_share=lost_share)
        each = next(sent, None)
        out = []
        for tick in range(1, int(seconds / PERIOD_S)):
            now_s = tick * PERIOD_S
            while each is not None and each.at_s <= now_s:
                self.suit.on_frame(each.bus, each.frame.id, each.frame.data, to_ns(each.at_s))
                each = next(sent, None)
            self.suit.open_window(tick, to_ns(now_s))
            out.append(self.suit.close_window(to_ns(now_s)))
        return out


def polled(readings: list[Reading], tick: int, at_ns: int) -> Sweep:
    """What the same nodes would have answered to a SYNC at that instant."""
    values = np.array([reading(1e-9 * at_ns)[0] for reading in readings])
    yes = np.ones(len(readings), np.bool_)
    return Sweep(tick, at_ns, at_ns, values[:, :3], values[:, 3:6], values[:, 6:], yes, ~yes)


def apart_deg(sweeps: list[Sweep], readings: list[Reading], configs: list[NodeConfig]) -> Array:
    """(T, N) between the orientations of the two, once the motion has begun."""
    free, asked = (Estimator(EstimationConfig(), configs, 200.0) for _ in range(2))
    before_ns: int | None = None
    out = []
    for sweep in sweeps:
        dt_s = None if before_ns is None else 1e-9 * (sweep.sampled_ns - before_ns)
        before_ns = sweep.sampled_ns
        free.update(sweep, dt_s, sweep.q_world_from_sensor)
        asked.update(polled(readings, sweep.tick, sweep.sampled_ns), dt_s)
        if sweep.sampled_ns > to_ns(REST_S):
            one, other = free.posture(), asked.posture()
            out.append(np.degrees(angle_between(one.q_world_from_segment, other.q_world_from_segment)))
    return np.array(out)


@pytest.mark.timeout(600)
@pytest.mark.long
def test_orientations_are_those_of_the_suit_on_sync(
    load: Callable[..., MappedLayout], swing: Callable[..., Reading]
) -> None:
    readings = [swing(k, rest_s=REST_S) for k in range(36)]
    run = FreeRun(load("mti", 1), readings, [100.0, 200.0, 400.0] * 12)
    sweeps = run.sweeps(8.0, lost_share=0.0025)  # of four frames a sample: 1 % of the samples
    late = apart_deg(sweeps, readings, run.configs)
    figures = f"median {np.median(late):.3f}, 99 % {np.quantile(late, 0.99):.3f}, worst {late.max():.3f}°"
    assert np.quantile(late, 0.99) <= 0.1, figures


@pytest.mark.parametrize("throttled_hz", [50.0, 80.0, 96.0, 120.0])
def test_a_node_without_count_or_time_that_is_throttled_keeps_the_time(
    load: Callable[..., MappedLayout], swing: Callable[..., Reading], throttled_hz: float
) -> None:
    """Its orientation at the grid's instants is that of the moment: 5 ms at 90°/s would be 0.45°."""
    readings = [swing(k, rest_s=1.0) for k in range(2)]
    run = FreeRun(load("bno", 1), readings, [100.0, 100.0], throttled_hz, throttled_s=3.0)
    off_deg = []
    for sweep in run.sweeps(17.0, lost_share=0.0):
        at_s = 1e-9 * sweep.sampled_ns
        if at_s > 14.0:
            q = sweep.q_world_from_sensor
            assert q is not None
            true = np.array([reading(at_s)[1] for reading in readings])
            off_deg.append(np.degrees(angle_between(q, true)))
    assert np.quantile(off_deg, 0.99) < 0.25
