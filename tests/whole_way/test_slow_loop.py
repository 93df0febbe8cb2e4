"""A loop of 100 Hz whose readings are at times a cycle of the drives late: that is nobody who pushes."""

from __future__ import annotations

import numpy as np
import pytest

from deploy.experiments.demo.options import DemoOptions
from deploy.sim.world.world import VirtualWorld, WorldSettings
from slave.contact.config import ContactConfig
from slave.servos.mujoco.simulated import CYCLE_NS, SimulatedRobot

SECONDS = 12.0
pytestmark = pytest.mark.long


def contacts(loop_hz: int) -> int:
    """How often the robot was told that it is pushed while it followed the bottle."""
    overrides = DemoOptions().overrides()
    overrides["slave"] = [*overrides["slave"], f"loop.rate_hz={loop_hz}"]
    overrides["master"] = ["estimation.zero_pose_s=1.0"]
    world = VirtualWorld(WorldSettings(overrides=overrides))
    world.engage()
    states = len(world.states)
    world.run(SECONDS)
    sent = len(world.states) - states
    assert sent == pytest.approx(SECONDS * loop_hz / world.slave_config.loop.state_every, abs=2.0)
    return world.slave.contact.count


@pytest.fixture
def late_readings(monkeypatch: pytest.MonkeyPatch) -> None:
    """As where the physics' thread and the loop meet at one instant."""
    random, on_time = np.random.default_rng(1), SimulatedRobot.advance

    def advance(robot: SimulatedRobot, until_ns: int) -> None:
        on_time(robot, until_ns - CYCLE_NS * int(random.integers(2)))

    monkeypatch.setattr(SimulatedRobot, "advance", advance)


@pytest.mark.usefixtures("late_readings")
@pytest.mark.parametrize("loop_hz", [200, 100])
def test_readings_that_come_late_are_no_push(loop_hz: int) -> None:
    assert contacts(loop_hz) == 0


@pytest.mark.usefixtures("late_readings")
def test_without_the_allowance_of_a_slow_loop_they_are(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ContactConfig, "for_loop", lambda config, _: config)
    assert contacts(100) > 0
