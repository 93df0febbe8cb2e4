"""The rate of commands follows the line while the robot tracks: faster over a good one, 12.5 Hz over a bad.

The robot must not notice a change but by following better or worse, and the recording must compute again.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import groupby

import numpy as np
import pytest

from common.clock import NS_PER_S
from deploy.experiments.demo.options import DemoOptions
from deploy.recorded.files import entries_of, head_of
from deploy.recorded.recompute import Replay
from deploy.recorded.recorded_config import recorded_config
from deploy.sim.network.profile import Profile, Way
from deploy.sim.world.world import VirtualWorld
from slave.limit.limit import Setpoint
from slave.servos.servos import EncoderReading
from tests.deploy.recorded.virtual import RecordedRun, record_run

NEAR = Profile(both=Way(delay_ms=1.0))
FAR = Profile(both=Way(delay_ms=25.0))
ROUGH = Profile(both=Way(delay_ms=25.0, jitter_ms=20.0))
NEAR_CHANGE_S = 0.3


@dataclass
class Seen:
    """What the story saw."""

    at_ns: list[int] = field(default_factory=list)
    setpoint_rad: list[np.ndarray] = field(default_factory=list)
    guard: set[str] = field(default_factory=set)
    words: list[str] = field(default_factory=list)
    missing: int = 0
    losses: dict[str, int] = field(default_factory=dict)
    commands: list[tuple[int, int]] = field(default_factory=list)
    """When each was sampled, and the period it says, ms."""


def story(world: VirtualWorld, seen: Seen) -> None:
    """Near, far, rough: each long enough for the rate to follow."""
    world.link.set(NEAR, world.now_ns)
    world.engage()

    def watch(_: EncoderReading, setpoint: Setpoint) -> None:
        seen.at_ns.append(world.now_ns)
        seen.setpoint_rad.append(setpoint.position_rad.copy())
        seen.guard.add(str(world.slave.guard.state))

    world.inject.watch = watch
    for line, seconds in ((NEAR, 5.0), (FAR, 3.0), (FAR, 6.0), (ROUGH, 4.0)):
        world.link.set(line, world.now_ns)
        world.run(seconds)
        seen.words.append(world.slave.traffic.rate.words)
    seen.missing = world.slave.traffic.due.metrics().missing
    seen.losses = dict(world.slave.guard.counters.losses)
    seen.commands = [(c.stamps.sampled_ns, c.period_ms) for c in world.commands]


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> tuple[RecordedRun, Seen]:
    seen, overrides = Seen(), DemoOptions().overrides()
    overrides["master"] = [*overrides["master"], 'capture.command_hz="auto"']
    folder = tmp_path_factory.mktemp("rate")
    return record_run(folder, lambda world: story(world, seen), overrides=overrides), seen


def test_the_rate_goes_up_with_the_line_and_down_at_once(run: tuple[RecordedRun, Seen]) -> None:
    _, seen = run
    periods = [period for period, _ in groupby(seen.commands, key=lambda sent: sent[1])]
    assert periods[:2] == [80, 20]
    assert periods[-1] == 80
    assert "jitter" in seen.words[-1]
    assert "tried again" in seen.words[-1]


def test_it_sends_as_often_as_it_says(run: tuple[RecordedRun, Seen]) -> None:
    _, seen = run
    for period_ms, sent in groupby(seen.commands, key=lambda sent: sent[1]):
        apart_ms = np.diff([sampled_ns for sampled_ns, _ in sent]) / 1e6
        assert apart_ms[1:] == pytest.approx(period_ms, abs=0.1)
        assert all(apart_ms[:1] <= period_ms + 0.1)


def test_the_robot_follows_all_the_way_and_no_command_counts_as_missing(
    run: tuple[RecordedRun, Seen],
) -> None:
    _, seen = run
    assert seen.guard == {"track"}
    assert not seen.losses
    assert seen.missing == 0


def test_no_change_of_the_rate_is_felt(run: tuple[RecordedRun, Seen]) -> None:
    """The largest step of the setpoints' velocity near a change is no larger than elsewhere."""
    _, seen = run
    at_ns = np.array(seen.at_ns)
    steps = np.abs(np.diff(seen.setpoint_rad, n=2, axis=0)).max(axis=1)
    changes = [b[0] for a, b in zip(seen.commands, seen.commands[1:], strict=False) if a[1] != b[1]]
    assert len(changes) >= 2
    near = np.zeros(len(steps), np.bool_)
    for changed_ns in changes:
        near |= np.abs(at_ns[2:] - changed_ns) < NEAR_CHANGE_S * NS_PER_S
    assert steps[near].max() <= steps[~near].max()


def test_its_recording_computes_again_to_the_last_bit(run: tuple[RecordedRun, Seen]) -> None:
    recorded, _ = run
    with recorded_config(head_of(recorded.master), str(recorded.master)) as config:
        pairs = list(Replay(config).pairs(entries_of([recorded.master], 0)))
    assert len(pairs) > 300
    assert all(pair.identical for pair in pairs)
