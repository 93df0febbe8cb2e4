"""A simulated drive reads its angle when SYNC arrives, however late its process gets to it."""

from __future__ import annotations

import can
import numpy as np
import pytest

from common.clock import NS_PER_S
from common.skeleton import load_skeleton
from deploy.sim.drives import app
from deploy.sim.drives.plant import LATEST_CYCLES, Plant
from slave.encoders.counts import EncoderConfig
from slave.servos.mujoco.simulated import CYCLE_NS

NECK = 0


def turning() -> tuple[Plant, float]:
    """The neck turns; the plant, and its rate."""
    plant, now_ns = Plant(load_skeleton("nursing"), EncoderConfig(), 0), 0
    plant.follow(NECK, 0.5, NS_PER_S // 2, 0)
    for _ in range(60):
        before, now_ns = plant.position_rad[NECK], now_ns + CYCLE_NS
        plant.advance(now_ns)
    return plant, float(plant.position_rad[NECK] - before) / CYCLE_NS


def test_an_angle_is_that_of_the_arrival() -> None:
    plant, rate = turning()
    now_ns, here = 60 * CYCLE_NS, plant.position_rad[NECK]
    for late_ns in (0, CYCLE_NS // 2, 2 * CYCLE_NS):
        seen = plant.seen_rad(now_ns - late_ns)[NECK]
        assert here - seen == pytest.approx(rate * late_ns, rel=0.05, abs=1e-9)
    oldest = plant.seen_rad(now_ns - LATEST_CYCLES * CYCLE_NS)
    assert (plant.seen_rad(0) == oldest).all()
    assert np.isfinite(oldest).all()


@pytest.mark.parametrize(
    ("age_s", "late_s"), [(0.01, 0.01), (0.75, 0.75), (1.0, 0.0), (2.0, 0.0), (-0.5, 0.0)]
)
def test_the_kernel_s_stamp_counts_where_it_can_be_right(
    monkeypatch: pytest.MonkeyPatch, age_s: float, late_s: float
) -> None:
    monkeypatch.setattr("time.time", lambda: 1000.0)
    monkeypatch.setattr(app, "monotonic_ns", lambda: 5 * NS_PER_S)
    arrived = app.arrived_ns(can.Message(timestamp=1000.0 - age_s))
    assert arrived == pytest.approx(5 * NS_PER_S - late_s * NS_PER_S, abs=1000)
