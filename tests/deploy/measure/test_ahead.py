"""The robot that will be, against the encoders of a whole robot on the virtual clock."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from common.clock import NS_PER_MS
from deploy.measure.ahead import FIRST_TUBE_RAD, AheadScore, Foretold, RobotAhead
from deploy.sim.world.world import VirtualWorld, WorldSettings

EVERY_NS = 40 * NS_PER_MS
FOLLOWED_S = 14.0


class Watched(VirtualWorld):
    """Its operator's page foretells the robot 25 times a second."""

    def __init__(self, settings: WorldSettings) -> None:
        super().__init__(settings)
        self.ahead = RobotAhead(self.slave_config.skeleton)
        self.foretold: list[Foretold] = []
        self._told, self._next_ns = 0, 0

    def _on_state(self, payload: bytes) -> None:
        super()._on_state(payload)
        for command in self.commands[self._told :]:
            self.ahead.on_command(command)
        self._told = len(self.commands)
        self.ahead.on_state(self.states[-1], self.master_ns)
        if self.master_ns >= self._next_ns:
            self._next_ns = self.master_ns + EVERY_NS
            found = self.ahead.foretell(self.master_ns)
            if found is not None:
                self.foretold.append(found)


def followed(one_way_ms: int) -> Watched:
    world = Watched(WorldSettings(one_way_ns=one_way_ms * NS_PER_MS))
    world.engage()
    world.run(FOLLOWED_S)
    return world


@pytest.fixture(scope="module")
def far() -> Watched:
    return followed(100)


def score_of(world: Watched) -> AheadScore:
    score = world.ahead.score()
    assert score is not None
    return score


@pytest.mark.long
@pytest.mark.timeout(400)
def test_it_is_nearer_to_the_encoders_than_the_newest_state(far: Watched) -> None:
    score = score_of(far)
    assert score.count > 300
    assert 100.0 < score.ahead_ms < 130.0
    assert score.rms_deg < 0.35 * score.held_rms_deg, score
    assert 85.0 < score.inside_percent < 99.5, score


@pytest.mark.long
@pytest.mark.timeout(400)
def test_the_tube_is_learnt(far: Watched) -> None:
    assert far.foretold[0].tube_rad == pytest.approx(FIRST_TUBE_RAD)
    last = far.foretold[-1].tube_rad
    assert (last < FIRST_TUBE_RAD).all()
    # none is wider than what a joint of this motion can err by
    assert 0.0017 < np.median(last) < 0.05


@pytest.mark.long
@pytest.mark.timeout(400)
def test_a_robot_that_holds_is_not_foretold_and_begins_anew(far: Watched) -> None:
    ahead, state = far.ahead, far.states[-1]
    held = replace(state, guard="hold", encoder_ns=state.encoder_ns + 1)
    ahead.on_state(held, far.master_ns)
    assert ahead.foretell(far.master_ns) is None
    again = replace(state, encoder_ns=state.encoder_ns + 2)
    ahead.on_state(again, far.master_ns)
    found = ahead.foretell(far.master_ns)
    assert found is not None
    np.testing.assert_array_equal(found.position_rad, state.position_rad)


def test_without_a_state_or_a_trusted_clock_nothing_is_foretold() -> None:
    ahead = RobotAhead(VirtualWorld(WorldSettings()).slave_config.skeleton)
    assert ahead.foretell(10**9) is None
    assert ahead.score() is None
