"""An axis that stands is told as soon as its own noise rules chance out, and a quiet one never by chance."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from master.suit.chance import NEVER, RepeatChance, longest_repeat
from master.suit.plausibility import PlausibilityWatch
from master.suit.plausibility_config import PlausibilityConfig
from master.suit.protocol import SuitProtocol
from master.suit.sweep import Sweep

SCALE = SuitProtocol.load().fd.scale
YEAR = 6 * 36 * 200.0 * 365.25 * 86400


def rest(sigma: float, nodes: int, ticks: int, seed: int = 5) -> np.ndarray:
    """Counts (T, N, 9) of nodes at rest, their gyros between any two counts."""
    random = np.random.default_rng(seed)
    truth = np.zeros((nodes, 9))
    truth[:, 2] = 4096.3
    truth[:, 3:6] = random.uniform(-20.0, 20.0, (nodes, 3))
    noise = np.repeat([8.0, sigma, 1.0], 3)
    return np.rint(truth + noise * random.standard_normal((ticks, nodes, 9)))


def said(counts: np.ndarray) -> list[tuple[int, int, str]]:
    """(tick, node, words) of every doubt as it begins."""
    count = counts.shape[1]
    watch = PlausibilityWatch(PlausibilityConfig(), count, 200.0, SCALE)
    yes, no = np.ones(count, np.bool_), np.zeros(count, np.bool_)
    out: list[Any] = []
    before: set[Any] = set()
    for tick, v in enumerate(counts * SCALE):
        watch.take(Sweep(tick, 1 + 5_000_000 * tick, 0, v[:, :3], v[:, 3:6], v[:, 6:], yes, no), v)
        doubts = watch.doubts()
        out += [(tick, node, doubts[node].words) for node in doubts.keys() - before]
        before = set(doubts)
    return out


@pytest.mark.parametrize("sigma", [0.25, 0.4, 0.6, 0.9, 1.5])
def test_nodes_at_rest_are_believed_however_quiet_their_gyros(sigma: float) -> None:
    """With one limit of 0.5 s for all, gyros of 0.25 counts were called stuck within seconds."""
    assert said(rest(sigma, nodes=36, ticks=4000)) == []


@pytest.mark.parametrize(
    ("sigma", "within_s"), [(1.5, 0.2), (1.0, 0.2), (0.9, 0.22), (0.75, 0.3), (0.5, 0.7)]
)
def test_a_stuck_axis_at_rest_is_told_as_soon_as_its_noise_permits(sigma: float, within_s: float) -> None:
    counts = rest(sigma, nodes=36, ticks=2300)
    counts[2000:, :, 4] = counts[1999, :, 4]
    told = said(counts)
    assert {node for _, node, _ in told} == set(range(36))
    assert all("gyroscope y is stuck" in words for *_, words in told)
    assert min(tick for tick, *_ in told) > 2000
    assert max(tick for tick, *_ in told) <= 2000 + 200 * within_s


@pytest.mark.parametrize("sigma", [0.3, 0.5, 0.8, 1.2])
@pytest.mark.parametrize("correlation", [0.0, 0.6])
def test_the_noise_is_never_taken_for_more_than_it_is(sigma: float, correlation: float) -> None:
    random = np.random.default_rng(11)
    white = random.standard_normal((1200, 36, 6))
    noise = white.copy()
    for i in range(1, len(noise)):
        noise[i] = correlation * noise[i - 1] + math.sqrt(1 - correlation**2) * white[i]
    counts = np.rint(np.linspace(0.0, 1.0, 36)[:, None] + sigma * noise)
    chance = RepeatChance(36, 200.0, np.ones(6), 400.0)
    for window in counts.reshape(60, 20, 36, 6):
        chance.learn(window, np.ones((36, 6), np.bool_))
    assert (chance.sigma_counts() <= sigma).all()


@pytest.mark.parametrize("sigma", [0.3, 0.5, 1.0])
def test_chance_is_below_once_a_year(sigma: float) -> None:
    samples = longest_repeat(np.array([sigma]), YEAR)[0]
    stays = math.erf(0.5 / (sigma * math.sqrt(2.0)))
    assert YEAR * stays**samples <= 1.0
    assert YEAR * stays ** (samples - 1) > 1.0


def test_what_is_not_known_is_not_judged() -> None:
    chance = RepeatChance(1, 200.0, np.ones(6), 400.0)
    assert (chance.samples == NEVER).all()
    chance.learn(np.zeros((400, 1, 6)), np.ones((1, 6), np.bool_))
    chance.conclude()
    assert (chance.samples == NEVER).all()
