"""`command_hz = "auto"` on real people: the line bears more commands, and the robot follows nearer by them.

`pytest -s` prints the figures that docs/command-rate.md shows.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import pytest

from common.wire.messages import Action
from deploy.experiments.demo.options import DemoOptions
from deploy.harness.link_settings import needed_age_s
from deploy.measure import Trace, motion
from deploy.sim.network import load_profile
from deploy.sim.world.world import VirtualWorld, WorldSettings

SETTLED_S = 8.0
"""Until the rate has gone up: 5 s of evidence."""
SECONDS = 30


@dataclass(frozen=True, slots=True)
class Found:
    """One run of held-out people at natural speed."""

    periods_ms: tuple[int, ...]
    """Of the commands, the usual one first."""
    holds: int
    rmse_deg: float
    lag_ms: float
    roughness: float


def run(network: str, command_hz: str) -> Found:
    profile, overrides = load_profile(network), DemoOptions(motion="capture").overrides()
    overrides["master"] = [*overrides["master"], f"capture.command_hz={command_hz}"]
    overrides["slave"] = [*overrides["slave"], f"guard.max_age_s={needed_age_s(profile)}"]
    settings = WorldSettings(network=profile, slave_ahead_ns=0, slave_drift_ppm=0.0, overrides=overrides)
    world = VirtualWorld(settings)
    world.engage()
    world.run(SETTLED_S)
    sent, world.trace = len(world.commands), Trace(world.trace.joint_names)
    for _ in range(SECONDS):
        world.run(1.0)
        if world.slave.guard.state == "hold":
            world.ask(Action.ENGAGE)
    followed = motion(world.trace.truth(), world.moved(), world.trace.joint_names)
    assert followed is not None
    assert followed.lag_ms is not None
    assert followed.roughness is not None
    periods = Counter(command.period_ms for command in world.commands[sent:])
    found = Found(
        tuple(period for period, _ in periods.most_common()), sum(world.slave.guard.counters.losses.values()),
        followed.rmse_deg, followed.lag_ms, followed.roughness,
    )  # fmt: skip
    print(network, command_hz, found)  # noqa: T201
    return found


@pytest.mark.long
@pytest.mark.timeout(900)
@pytest.mark.parametrize(("network", "period_ms", "most_rmse"), [("lan", 20, 0.92), ("4g", 40, 0.88)])
def test_people_are_followed_nearer_at_the_rate_that_the_line_bears(
    recordings_folder: Path, network: str, period_ms: int, most_rmse: float
) -> None:
    """Over the same at 12.5 Hz. What is left at any rate is the joints' own limits (docs/trials.md)."""
    usual, auto = run(network, "12.5"), run(network, '"auto"')
    assert usual.periods_ms == (80,)
    assert auto.periods_ms == (period_ms,)
    assert auto.holds == usual.holds == 0
    assert auto.rmse_deg <= most_rmse * usual.rmse_deg
    assert auto.lag_ms <= 0.8 * usual.lag_ms
    assert auto.roughness <= 1.2
