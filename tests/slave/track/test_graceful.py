"""Lost messages, velocities that are not known, a delay that jumps, a clock that steps: no jump, no swing."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from common.clock import to_ns
from common.quaternion import Array
from slave.track import Tracker
from slave.track.config import TrackConfig, make_tracker
from tests.slave.track.reaches import Operator, World

TICK_S = 0.005
SMOOTH = ("interpolate", "predict")
WORLD = World(seed=4, seconds=12.0, joints=6)
OPERATOR = Operator(WORLD)
PEAK_RAD_S = 4.2
"""Of the reaches: 60° in 0.5 s."""
PEAK_RAD_S2 = 25.0


@dataclass(frozen=True)
class Sample:
    sampled_s: float
    arrives_s: float
    position_rad: Array
    velocity_rad_s: Array


Change = Callable[[int, Sample], Sample | None]


def samples(change: Change, one_way_s: float = 0.03) -> list[Sample]:
    """The operator's samples as a link changes them, in the order of their arrival."""
    out: list[Sample] = []
    for k, at_s in enumerate(np.arange(0.0, WORLD.seconds, WORLD.period_s).tolist()):
        position, velocity = (a[0] for a in OPERATOR.at(np.array([at_s])))
        changed = change(k, Sample(at_s, at_s + one_way_s, position, velocity))
        if changed is not None:
            newest_s = out[-1].arrives_s if out else 0.0
            late_s = max(changed.arrives_s, newest_s)
            out.append(Sample(changed.sampled_s, late_s, changed.position_rad, changed.velocity_rad_s))
    return out


def targets(tracker: Tracker, taken: list[Sample]) -> tuple[Array, Array, Array]:
    """Times (T,), target positions and velocities (T, J)."""
    taken, rows = list(taken), []
    for now_s in np.arange(taken[0].arrives_s, WORLD.seconds, TICK_S).tolist():
        while taken and taken[0].arrives_s <= now_s:
            s = taken.pop(0)
            tracker.accept(to_ns(s.sampled_s), to_ns(s.arrives_s), s.position_rad, s.velocity_rad_s)
        target = tracker.target(to_ns(now_s))
        assert target is not None
        rows.append((now_s, target.position_rad, target.velocity_rad_s))
    times_s, positions, velocities = zip(*rows, strict=True)
    return np.array(times_s), np.array(positions), np.array(velocities)


def lost(begin: int, count: int) -> Change:
    return lambda k, s: None if begin <= k < begin + count else s


def slower(k: int, s: Sample) -> Sample:
    """30 ms, but 150 ms from 4 s to 8 s."""
    late_s = 0.12 if 4.0 <= s.sampled_s < 8.0 else 0.0
    return Sample(s.sampled_s, s.arrives_s + late_s, s.position_rad, s.velocity_rad_s)


def blind(k: int, s: Sample) -> Sample:
    """Velocities are not known from 4 s to 8 s."""
    known = not 4.0 <= s.sampled_s < 8.0
    return Sample(s.sampled_s, s.arrives_s, s.position_rad, s.velocity_rad_s * known)


def stepped(by_s: float) -> Change:
    """The measured offset of the clocks steps at 5 s."""
    return lambda k, s: Sample(
        s.sampled_s + by_s * (s.sampled_s >= 5.0), s.arrives_s, s.position_rad, s.velocity_rad_s
    )


TROUBLES: dict[str, Change] = {
    "none": lambda k, s: s,
    "one lost": lost(60, 1),
    "two lost": lost(60, 2),
    "five lost": lost(60, 5),
    "delay jumps to 150 ms and back": slower,
    "velocities unknown": blind,
    "offset steps ahead": stepped(0.03),
    "offset steps back": stepped(-0.03),
}


@pytest.mark.parametrize("strategy", SMOOTH)
@pytest.mark.parametrize("trouble", TROUBLES)
def test_the_target_stays_continuous_and_near_the_operator(strategy: str, trouble: str) -> None:
    tracker = make_tracker(TrackConfig.model_validate({"strategy": strategy}))
    times_s, positions, velocities = targets(tracker, samples(TROUBLES[trouble]))
    moved = np.diff(positions, axis=0)
    mean_rad_s = 0.5 * (velocities[1:] + velocities[:-1])
    # the position is the integral of the velocity: nowhere a jump, whatever came
    assert np.abs(moved - TICK_S * mean_rad_s).max() < np.deg2rad(0.5)
    assert np.abs(velocities).max() < 2.5 * PEAK_RAD_S
    # a blend may ask for more than a joint can: the guard, behind it, gives what is safe
    assert np.abs(np.diff(velocities, axis=0)).max() / TICK_S < 20.0 * PEAK_RAD_S2
    low, high = positions.min(axis=0), positions.max(axis=0)
    truth, _ = OPERATOR.at(times_s)
    # turning points are overshot by what five lost samples lead astray at most
    assert (truth.min(axis=0) - low).max() < np.deg2rad(25.0)
    assert (high - truth.max(axis=0)).max() < np.deg2rad(25.0)


@pytest.mark.parametrize("strategy", SMOOTH)
@pytest.mark.parametrize("trouble", ["one lost", "two lost", "five lost"])
def test_half_a_second_after_a_loss_it_is_where_it_would_have_been(strategy: str, trouble: str) -> None:
    config = TrackConfig.model_validate({"strategy": strategy})
    times_s, troubled, _ = targets(make_tracker(config), samples(TROUBLES[trouble]))
    _, plain, _ = targets(make_tracker(config), samples(TROUBLES["none"]))
    count = {"one lost": 1, "two lost": 2, "five lost": 5}[trouble]
    back_s = 0.08 * (60 + count) + 0.03
    after = (times_s > back_s + 0.5) & (times_s < back_s + 2.0)
    assert np.sqrt(np.mean((troubled - plain)[after] ** 2)) < np.deg2rad(1.5)


def test_predict_is_as_near_after_the_delay_has_come_back_as_before() -> None:
    times_s, positions, _ = targets(make_tracker(TrackConfig()), samples(slower))
    lead_s = TrackConfig().servo_lag_s
    truth, _ = OPERATOR.at(times_s + lead_s)
    error = np.sqrt(np.mean((positions - truth) ** 2, axis=1))
    before, during, after = (
        np.sqrt(np.mean(error[(times_s > a) & (times_s < b)] ** 2)) for a, b in ((1, 4), (5, 8), (8.7, 11.7))
    )
    assert after < 1.5 * before
    assert before < during < np.deg2rad(10.0)


def test_without_velocities_predict_is_still_better_than_latest() -> None:
    taken = samples(blind)
    figures = []
    for strategy in ("latest", "predict"):
        config = TrackConfig.model_validate({"strategy": strategy})
        times_s, positions, _ = targets(make_tracker(config), taken)
        truth, _ = OPERATOR.at(times_s + config.servo_lag_s)
        dark = (times_s > 4.5) & (times_s < 8.0)
        figures.append(float(np.sqrt(np.mean((positions - truth)[dark] ** 2))))
    assert figures[1] < 0.75 * figures[0]


transits_ms = st.lists(st.one_of(st.none(), st.integers(1, 300)), min_size=5, max_size=25)


@settings(deadline=None, max_examples=60)
@given(transits_ms, st.floats(-20.0, 20.0), st.integers(0, 1000))
def test_whatever_a_link_does_the_target_is_finite_and_continuous(
    transits: list[int | None], speed: float, seed: int
) -> None:
    random = np.random.default_rng(seed)
    # a queue, as over tcp: what comes late makes what follows late
    tracker, arrives_s, before, position = make_tracker(TrackConfig()), 0.0, None, np.zeros(2)
    for k, transit in enumerate(transits):
        if transit is None:
            continue
        until_s = max(arrives_s, 0.08 * k + transit / 1e3)
        for now_s in np.arange(arrives_s, until_s, 0.02).tolist():
            target = tracker.target(to_ns(now_s))
            assert target is None or np.isfinite([target.position_rad, target.velocity_rad_s]).all()
        arrives_s = until_s
        before = tracker.target(to_ns(arrives_s))
        position, velocity = random.normal(0.0, 1.0, 2), np.array([speed, random.normal()])
        tracker.accept(to_ns(0.08 * k), to_ns(arrives_s), position, velocity)
        after = tracker.target(to_ns(arrives_s))
        assert after is not None
        if before is not None:
            np.testing.assert_allclose(after.position_rad, before.position_rad, atol=1e-9)
            np.testing.assert_allclose(after.velocity_rad_s, before.velocity_rad_s, atol=1e-7)
