"""An operator who reaches into herself: suit, master, slave and robot; the robot does not meet itself."""

from __future__ import annotations

import numpy as np
import pytest

from common.quaternion import Array
from common.skeleton import load_skeleton
from deploy.measure.apart import Distances
from deploy.sim.suit.motion import load_motion
from deploy.sim.world.world import VirtualWorld, WorldSettings
from slave.limit.damper import DistanceDamper
from tests.whole_way.runs import engaged

SKELETON = load_skeleton("nursing")
MARGIN_M, SLACK_M = 0.02, 0.002


def crossed(seconds: float) -> tuple[VirtualWorld, Array]:
    """A run through the motion, and its setpoints."""
    run = engaged(WorldSettings(motion=load_motion("crossed", SKELETON)))
    setpoints: list[Array] = []
    run.inject.watch = lambda _, setpoint: setpoints.append(setpoint.position_rad)
    run.run(seconds)
    return run, np.array(setpoints)


@pytest.mark.timeout(300)
def test_the_robot_keeps_apart_and_follows_all_the_while() -> None:
    run, setpoints = crossed(16.0)
    least_m = Distances(SKELETON).own_m(setpoints).min()
    assert MARGIN_M - SLACK_M <= least_m < MARGIN_M + 0.005
    assert run.slave.guard.state == "track", "nothing made it hold"
    assert run.slave.guard.counters.clamps["distance"] > 0
    told = {state.faults["distance"] for state in run.states if "distance" in state.faults}
    assert any("forearm is held off by the " in words and "2 cm from it" in words for words in told)
    assert any("held off by the head, " in words for words in told)
    assert any("held off by the chest, " in words for words in told)
    assert np.abs(setpoints[-1] - run.commands[-1].position_rad).max() < 0.1, "it has left with the operator"
    encoders = np.array([state.position_rad for state in run.states])
    assert Distances(SKELETON).own_m(encoders).min() > 0.5 * MARGIN_M, "the drives' lag takes less than half"


def test_without_the_damper_the_same_run_collides(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(DistanceDamper, "limit", lambda _, step: step.wish_rad_s)
    _, setpoints = crossed(5.0)
    assert Distances(SKELETON).own_m(setpoints).min() < -0.05
