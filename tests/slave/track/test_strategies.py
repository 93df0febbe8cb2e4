"""The strategies side by side on simulated reaches: the figures of slave/track/README.md, with a margin."""

from dataclasses import replace

import numpy as np
import pytest

from slave.backends import ServosConfig
from slave.track.config import TrackConfig, make_tracker
from tests.slave.track.reaches import TICK_S, Figures, Run, Strategy, World, figures, run, tracker_for

WORLD = World(seconds=14.0)
UNLIMITED = replace(WORLD, max_velocity_deg_s=1e5, max_acceleration_deg_s2=1e8)


@pytest.fixture(scope="module")
def runs() -> dict[Strategy, Run]:
    strategies: tuple[Strategy, ...] = ("latest", "interpolate", "predict")
    return {s: run(tracker_for(s), WORLD) for s in strategies}


@pytest.fixture(scope="module")
def judged(runs: dict[Strategy, Run]) -> dict[Strategy, Figures]:
    return {strategy: figures(done) for strategy, done in runs.items()}


def test_predict_is_early_enough_near_enough_and_smooth_enough(judged: dict[Strategy, Figures]) -> None:
    predict = judged["predict"]
    assert abs(predict.lag_ms) <= 15.0
    assert predict.rmse_deg <= 0.25 * judged["latest"].rmse_deg
    assert predict.roughness <= 2.2


def test_interpolate_is_late_and_the_smoothest(judged: dict[Strategy, Figures]) -> None:
    interpolate = judged["interpolate"]
    assert interpolate.lag_ms == pytest.approx(132.0, abs=5.0)
    assert interpolate.aligned_rmse_deg <= 0.3
    assert interpolate.roughness <= 1.2


def test_predict_needs_no_guard_to_be_smooth() -> None:
    unlimited = {s: figures(run(tracker_for(s), UNLIMITED)) for s in ("latest", "predict")}
    assert unlimited["predict"].rmse_deg <= 0.3 * unlimited["latest"].rmse_deg
    assert unlimited["predict"].roughness <= 2.1
    assert unlimited["latest"].lag_ms == pytest.approx(83.0, abs=5.0)


def test_predict_without_velocities_still_beats_latest(judged: dict[Strategy, Figures]) -> None:
    blind = figures(run(tracker_for("predict"), replace(WORLD, velocity_known=False)))
    assert blind.rmse_deg <= 0.6 * judged["latest"].rmse_deg


@pytest.mark.parametrize("strategy", ["interpolate", "predict"])
def test_a_smooth_strategy_asks_for_the_integral_of_its_velocity(
    runs: dict[Strategy, Run], strategy: Strategy
) -> None:
    done = runs[strategy]
    moved = np.diff(done.target_rad, axis=0)
    mean_rad_s = 0.5 * (done.target_rad_s[1:] + done.target_rad_s[:-1])
    assert np.abs(moved[200:] - TICK_S * mean_rad_s[200:]).max() < np.deg2rad(0.1)


def test_a_run_is_the_same_every_time() -> None:
    short = World(seconds=5.0, joints=3)
    first, second = (run(tracker_for("predict"), short) for _ in range(2))
    np.testing.assert_array_equal(first.robot_rad, second.robot_rad)


def test_predict_aims_ahead_by_the_bus_of_the_drives_too() -> None:
    servos = ServosConfig.model_validate({"backend": "canopen", "canopen": {"sync_hz": 50}})
    assert servos.bus_lag_s == pytest.approx(0.03)
    assert ServosConfig().bus_lag_s == 0.0
    still, early = (make_tracker(TrackConfig(), lag_s) for lag_s in (0.0, servos.bus_lag_s))
    rate = np.array([1.0, -0.5])
    for k in range(20):
        now_ns = k * 80_000_000
        for tracker in (still, early):
            tracker.accept(now_ns, now_ns, 0.08 * k * rate, rate)
    targets = [tracker.target(now_ns) for tracker in (still, early)]
    assert targets[0] is not None
    assert targets[1] is not None
    ahead = (targets[1].position_rad - targets[0].position_rad) / rate
    # the farther ahead, the less of the velocity is believed to last
    assert (ahead <= 0.03).all()
    assert (ahead >= 0.75 * 0.03).all()
