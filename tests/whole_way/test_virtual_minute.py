"""Both pipelines, suit and robot for a simulated minute: the same every time, in seconds, and right."""

from __future__ import annotations

import numpy as np
import pytest

from common.wire.codec import encode
from common.wire.messages import Action
from deploy.measure import accuracy
from deploy.measure.paper import ETA_PERCENT, TABLE_1
from deploy.sim.world.injection import Traffic
from deploy.sim.world.world import VirtualWorld, WorldSettings
from tests.whole_way.runs import engaged, judged


@pytest.fixture(scope="module")
def minute() -> VirtualWorld:
    run = engaged(WorldSettings())
    run.run(60.0)
    return run


def test_a_minute_passes_without_loss(minute: VirtualWorld) -> None:
    counters = minute.slave.guard.counters
    assert minute.slave.guard.state == "track"
    assert not counters.losses
    assert not counters.doubts
    assert not counters.dropped.keys() - {"lease", "clock"}, "only before the lease and the clock stood"
    sent_with_lease = sum(1 for c in minute.commands if c.lease)
    assert counters.accepted >= sent_with_lease - 15
    assert len(minute.commands) / ((minute.now_ns - 1e9) / 1e9) == pytest.approx(12.5, rel=0.01)


def test_angles_are_solved_better_than_the_papers(minute: VirtualWorld) -> None:
    found = accuracy(minute.trace.truth(), minute.trace.solved(), minute.trace.joint_names)
    assert found.eta_percent is not None
    assert found.eta_percent <= ETA_PERCENT
    for joint, paper in TABLE_1.items():
        worse = found.worse(joint)
        assert worse is not None
        assert worse.error_deg < paper.error_deg, joint


def test_the_slave_knows_the_masters_clock_within_its_bound(minute: VirtualWorld) -> None:
    offset = minute.slave.clock.estimator.estimate(minute.slave_ns)
    assert offset.trusted
    true_ns = minute.now_ns - minute.slave_ns
    assert abs(offset.offset_ns - true_ns) <= offset.bound_ns


def test_the_latency_budget_adds_up(minute: VirtualWorld) -> None:
    budget = minute.slave.traffic.journeys.budget
    stages = budget.summary()
    assert sum(stage.mean or 0.0 for stage in stages.values()) == pytest.approx(budget.total().mean)
    assert stages["put→received"].mean == pytest.approx(2.0, abs=0.1)
    assert stages["sampled→frames in"].mean == pytest.approx(1.0, abs=0.01)


def test_the_setpoint_never_breaks_a_limit(minute: VirtualWorld) -> None:
    skeleton = minute.slave_config.skeleton
    setpoints = np.array([s.setpoint_rad for s in minute.states])
    assert (setpoints >= skeleton.lower_rad - 1e-6).all()
    assert (setpoints <= skeleton.upper_rad + 1e-6).all()
    seconds = np.diff([s.encoder_ns for s in minute.states]) / 1e9
    rates = np.abs(np.diff(setpoints, axis=0)) / 0.02
    assert seconds.min() > 0
    assert (rates <= skeleton.max_velocity_rad_s * 1.02 + 1e-3).all()


def test_the_robot_follows_in_time_and_smoothly(minute: VirtualWorld) -> None:
    followed = judged(minute)
    assert followed.lag_ms is not None
    assert abs(followed.lag_ms) <= 25
    assert followed.roughness is not None
    assert followed.roughness <= 2.5


@pytest.mark.parametrize(("strategy", "one_way_ms"), [("interpolate", 2), ("predict", 80), ("latest", 80)])
def test_no_encoder_is_doubted_whatever_the_strategy_and_the_delay(strategy: str, one_way_ms: int) -> None:
    overrides = {"slave": [f'track.strategy="{strategy}"']}
    run = engaged(WorldSettings(one_way_ns=one_way_ms * 1_000_000, overrides=overrides))
    run.run(12.0)
    assert run.slave.guard.state == "track"
    assert not run.slave.guard.counters.doubts


def test_the_same_world_gives_the_same_bytes() -> None:
    def story() -> list[bytes]:
        run = VirtualWorld(WorldSettings())
        run.run(4.0)
        run.ask(Action.ENGAGE)
        run.run(3.0)
        return [encode(c) for c in run.commands] + [encode(s) for s in run.states]

    assert story() == story()


def test_after_a_cut_link_only_engaging_moves_the_robot() -> None:
    run = engaged(WorldSettings())
    run.run(4.0)
    carry = run.inject.carry
    run.inject.carry = lambda kind, payload: () if kind is Traffic.COMMAND else carry(kind, payload)
    cut_ns = run.slave_ns
    run.run(2.0, until=lambda: run.slave.guard.state == "hold")
    held_s = (run.slave_ns - cut_ns) / 1e9
    timeout_s = run.slave_config.guard.command_timeout_s
    assert timeout_s - 0.08 <= held_s <= timeout_s + 0.01
    run.run(1.0)
    run.inject.carry = carry
    still = run.states[-1].setpoint_rad
    run.run(3.0)
    assert run.slave.guard.state == "hold"
    np.testing.assert_array_equal(run.states[-1].setpoint_rad, still)
    assert run.ask(Action.ENGAGE).done
