"""A synthetic run whose operator, link and clock are known to the nanosecond."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from common.link.config import LinkConfig
from common.quaternion import Array
from common.skeleton import load_skeleton
from common.wire.messages import Command, CommandEcho, CommandStamps, RobotState
from deploy.measure import MovedSeries, TruthSeries
from deploy.measure.replay import Arrival, Comparison, arrivals, compare, replay
from slave.config import SlaveConfig
from slave.track.config import STRATEGIES

MS = 1_000_000
SKELETON = load_skeleton("nursing")
CONFIG = SlaveConfig(robot="robot-1", link=LinkConfig())
MOVING = [SKELETON.joint_names.index(f"{side}_shoulder_pitch") for side in ("left", "right")]
BEGIN_NS, SECONDS, TRANSIT_NS = 1_000 * MS, 12.0, 3 * MS
REST_RAD = np.clip(0.0, SKELETON.lower_rad, SKELETON.upper_rad)


def posture(time_s: Array) -> tuple[Array, Array]:
    """(T, J) position and velocity: both shoulders swing by ±0.5 rad, at different rates."""
    position = np.tile(REST_RAD, (len(time_s), 1))
    velocity = np.zeros_like(position)
    for joint, rate in zip(MOVING, (2.0, 3.0), strict=True):
        position[:, joint] = 0.5 * np.sin(rate * time_s)
        velocity[:, joint] = 0.5 * rate * np.cos(rate * time_s)
    return position, velocity


def at(now_ns: NDArray[np.int64]) -> tuple[Array, Array]:
    return posture((now_ns - BEGIN_NS) / 1e9)


def truth() -> TruthSeries:
    ticks = np.arange(round(SECONDS * 200), dtype=np.int64)
    stamps_ns = BEGIN_NS + 5 * MS * ticks
    return TruthSeries(ticks, stamps_ns, at(stamps_ns)[0])


def commands() -> list[Command]:
    sampled_ns = truth().sampled_ns[::16]
    position, velocity = at(sampled_ns)
    valid = np.ones(len(SKELETON.joints), np.bool_)
    return [
        Command("robot-1", 7, k + 1, 16 * k, CommandStamps(t, t, t, t), True, valid, position[k], velocity[k])
        for k, t in enumerate(sampled_ns.tolist())
    ]


def state(encoder_ns: int, echo: CommandEcho | None) -> RobotState:
    everywhere = np.ones(len(SKELETON.joints), np.bool_)
    position = at(np.array([encoder_ns]))[0][0]
    return RobotState(
        "robot-1",
        1,
        encoder_ns,
        encoder_ns,
        "track",
        "",
        "nurse-1",
        everywhere,
        position,
        position,
        echo,
        0,
        0,
    )


def moved() -> MovedSeries:
    """A real robot that follows perfectly."""
    stamps_ns = truth().sampled_ns[3:-1:4] + 2 * MS
    everywhere = np.ones((len(stamps_ns), len(SKELETON.joints)), np.bool_)
    return MovedSeries(stamps_ns, at(stamps_ns)[0], everywhere, everywhere[:, 0])


def accepted(transit_ns: int = TRANSIT_NS) -> list[Arrival]:
    return [Arrival(c.stamps.put_ns + transit_ns, c) for c in commands()]


def compared(transit_ns: int = TRANSIT_NS) -> Comparison:
    found = compare(truth(), moved(), accepted(transit_ns), CONFIG)
    assert found is not None
    return found


@pytest.fixture(scope="module")
def comparison() -> Comparison:
    return compared()


def lag_ms(comparison: Comparison, strategy: str) -> float:
    lag = comparison.replayed[strategy].lag_ms
    assert lag is not None
    return lag


def test_only_commands_the_slave_took_are_replayed_in_order() -> None:
    first, refused, second, unheard = commands()[:4]
    echoes = [CommandEcho(c.sequence, 0, 100 * c.sequence, 0, 0) for c in (first, second)]
    states = [state(BEGIN_NS, None), *(state(BEGIN_NS, echo) for echo in echoes for _ in range(4))]
    found = arrivals([second, refused, first, unheard], states)
    assert [(a.command, a.received_ns) for a in found] == [(first, 100), (second, 300)]


def test_a_perfect_robot_is_judged_beside_every_strategy(comparison: Comparison) -> None:
    assert list(comparison.replayed) == list(STRATEGIES)
    assert comparison.as_run.rmse_deg < 0.01
    assert comparison.rmse_over_latest == comparison.as_run.rmse_deg / comparison.replayed["latest"].rmse_deg


def test_latest_is_half_a_period_late_and_3_times_worse_than_predict(
    comparison: Comparison,
) -> None:
    latest, predict = comparison.replayed["latest"], comparison.replayed["predict"]
    assert predict.rmse_deg < latest.rmse_deg / 3
    assert abs(lag_ms(comparison, "predict")) < 10
    # transit, half of 80 ms on average, the servos' 31 ms, and what the limits smear of each step
    at_least = TRANSIT_NS / MS + 40 + 1e3 * CONFIG.track.servo_lag_s
    assert at_least - 3 < lag_ms(comparison, "latest") < at_least + 40


def test_interpolate_is_smooth_and_a_whole_period_late(comparison: Comparison) -> None:
    assert lag_ms(comparison, "interpolate") > TRANSIT_NS / MS + 80
    smooth, steps = comparison.replayed["interpolate"].roughness, comparison.replayed["latest"].roughness
    assert smooth is not None
    assert steps is not None
    assert smooth == pytest.approx(1.0, abs=0.1)
    assert steps > smooth


def test_commands_play_at_their_real_arrival(comparison: Comparison) -> None:
    slower = compared(TRANSIT_NS + 40 * MS)
    assert lag_ms(slower, "latest") - lag_ms(comparison, "latest") == pytest.approx(40, abs=4)


def test_the_replay_reads_when_the_robot_was_read_and_repeats() -> None:
    one, other = (replay(accepted(), moved(), "predict", CONFIG) for _ in range(2))
    late_ns = moved().encoder_ns - one.encoder_ns
    assert len(late_ns) == len(moved().encoder_ns)
    assert (late_ns >= 0).all()
    assert late_ns.max() < 10 * MS
    np.testing.assert_array_equal(one.position_rad, other.position_rad)


def test_a_joint_that_is_not_valid_is_held() -> None:
    valid = np.ones(len(SKELETON.joints), np.bool_)
    valid[MOVING[0]] = False
    held = [replace(a, command=replace(a.command, valid=valid)) for a in accepted()]
    ranges = np.ptp(replay(held, moved(), "predict", CONFIG).position_rad, axis=0)
    assert ranges[MOVING[0]] < np.radians(1.0)
    assert ranges[MOVING[1]] > 0.9


def test_only_the_end_of_a_long_run_is_replayed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("deploy.measure.replay.MOST_S", 4.0)
    shortened = compared()
    for judged in (shortened.as_run, *shortened.replayed.values()):
        # 50 readings a second, less the second in which a stretch settles and the search for the lag
        assert 100 < judged.samples < 3 * 50


def test_without_commands_tracking_or_truth_nothing_is_compared() -> None:
    still = replace(moved(), tracking=np.zeros(len(moved().tracking), np.bool_))
    nothing = TruthSeries(truth().tick[:0], truth().sampled_ns[:0], truth().position_rad[:0])
    assert compare(truth(), moved(), [], CONFIG) is None
    assert compare(truth(), still, accepted(), CONFIG) is None
    assert compare(nothing, moved(), accepted(), CONFIG) is None
