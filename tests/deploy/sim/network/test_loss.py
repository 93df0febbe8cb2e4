"""Loss in bursts: how much, how long, and how far a measured share may be off by chance."""

from __future__ import annotations

import random
from itertools import groupby

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from deploy.sim.network.loss import Losses, gilbert_elliott
from deploy.sim.network.profile import Way


def draw(way: Way, packets: int, seed: int = 1) -> list[bool]:
    losses = Losses(gilbert_elliott(way), random.Random(seed))
    return [losses.next() for _ in range(packets)]


@given(st.floats(0, 60), st.none() | st.floats(20, 100), st.floats(65, 100), st.floats(0, 0.1))
def test_the_model_loses_what_the_profile_says(
    percent: float, burst: float | None, inside: float, between: float
) -> None:
    percent = max(percent, between)
    way = Way(
        loss_percent=percent,
        burst_packets=burst,
        loss_in_burst_percent=inside,
        loss_between_percent=between,
    )
    model = gilbert_elliott(way)
    assert model.to_bad < 1.0
    assert 100.0 * model.mean == pytest.approx(percent, abs=1e-9)


@pytest.mark.parametrize(("burst", "length"), [(None, 1.0 / 0.95), (4.0, 4.0), (20.0, 20.0)])
def test_bursts_are_as_long_as_asked(burst: float | None, length: float) -> None:
    lost = draw(Way(loss_percent=5.0, burst_packets=burst), 400_000)
    runs = [sum(1 for _ in run) for is_lost, run in groupby(lost) if is_lost]
    assert np.mean(lost) == pytest.approx(0.05, abs=0.005)
    assert np.mean(runs) == pytest.approx(length, rel=0.05)


@pytest.mark.parametrize("burst", [None, 8.0])
def test_the_bound_holds_and_is_not_idle(burst: float | None) -> None:
    way = Way(loss_percent=3.0, burst_packets=burst, loss_in_burst_percent=60.0, loss_between_percent=0.3)
    packets = 2000
    bound = gilbert_elliott(way).bound(packets, sigmas=2.0)
    off = [abs(np.mean(draw(way, packets, seed)) - 0.03) for seed in range(200)]
    within = np.mean(np.array(off) < bound)
    assert 0.9 < within < 1.0  # two sigma: 95 %, and more with bursts
    assert within < 0.99 or burst
    ratio = gilbert_elliott(way).bound(packets) / gilbert_elliott(way).bound(4 * packets)
    assert 2.0 - 1e-9 <= ratio < 2.5


def test_with_few_bursts_one_long_one_is_no_surprise() -> None:
    way = Way(loss_percent=0.05, burst_packets=4.0)
    bound = gilbert_elliott(way).bound(1000)
    beyond = [np.mean(draw(way, 1000, seed)) - 0.0005 > bound for seed in range(1000)]
    assert np.mean(beyond) <= 0.003  # three sigma
    assert bound < 0.03
