"""The e-stop: from every state, by every path, latched."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from common.wire.messages import Action
from slave.guard import State

PATHS: dict[str, Callable[[Any], Any]] = {
    "the button at the robot": lambda rig: rig.guard.estop(rig.now_ns),
    "the operator": lambda rig: rig.ask(Action.ESTOP, "anna"),
    "a bystander": lambda rig: rig.ask(Action.ESTOP, "visitor"),
    "somebody without a name": lambda rig: rig.ask(Action.ESTOP, ""),
    "somebody with a wrong key": lambda rig: rig.ask(Action.ESTOP, "visitor", key="wrong"),
    "somebody who names another robot": lambda rig: rig.ask(Action.ESTOP, "anna", robot="robot-2"),
}


@pytest.mark.parametrize("path", PATHS.values(), ids=PATHS)
@pytest.mark.parametrize("state", State)
def test_every_path_stops_from_every_state(rig: Any, state: State, path: Callable[[Any], Any]) -> None:
    rig.to(state)
    path(rig)
    assert rig.guard.state is State.ESTOP
    assert "e-stop" in rig.guard.reason
    rig.run(0.2)
    assert rig.guard.state is State.ESTOP


@pytest.mark.parametrize("path", PATHS.values(), ids=PATHS)
def test_it_brakes_at_the_full_acceleration_to_standstill(rig: Any, path: Callable[[Any], Any]) -> None:
    rig.to_track()
    rig.target = rig.skeleton.lower_rad.copy()
    rig.run(0.1)
    before = rig.setpoints[-1]
    path(rig)
    brake = rig.skeleton.max_acceleration_rad_s2 * 0.005
    assert (before.velocity_rad_s < -brake).all()
    longest_s = (np.abs(before.velocity_rad_s) / rig.skeleton.max_acceleration_rad_s2).max()
    for _ in range(int(np.ceil(longest_s / 0.005)) + 1):
        after = rig.step()
        expected = np.minimum(before.velocity_rad_s + brake, 0.0)
        assert np.allclose(after.velocity_rad_s, expected, rtol=0, atol=1e-12)
        before = after
    assert not after.velocity_rad_s.any()
    assert np.array_equal(rig.step().position_rad, after.position_rad)


@pytest.mark.parametrize("action", sorted(set(Action) - {Action.RESET}))
def test_no_request_but_reset_leaves_it(rig: Any, action: Action) -> None:
    rig.to(State.ESTOP)
    rig.run(0.1)
    rig.ask(action, "anna", key="a key kept at the robot")
    rig.run(0.2)
    assert rig.guard.state is State.ESTOP


@pytest.mark.parametrize("changes", [{}, {"deadman_held": False}, {"sequence": 10**9}], ids=str)
def test_no_command_leaves_it(rig: Any, changes: dict[str, Any]) -> None:
    rig.to_track()
    rig.ask(Action.ESTOP, "visitor")
    still = rig.measured
    rig.target = rig.skeleton.lower_rad.copy()
    rig.run(2.0, **changes)
    assert rig.guard.state is State.ESTOP
    assert (rig.measured == still).all()


def test_neither_a_loss_nor_its_return_leaves_it(rig: Any) -> None:
    rig.to_track()
    rig.ask(Action.ESTOP)
    rig.encoder_valid[:] = False
    rig.run(1.5, commands=False)
    rig.encoder_valid[:] = True
    rig.run(0.5)
    assert rig.guard.state is State.ESTOP


def test_the_first_reason_is_kept(rig: Any) -> None:
    rig.to_track()
    rig.ask(Action.ESTOP, "anna")
    rig.ask(Action.ESTOP, "ben")
    assert rig.guard.reason == "e-stop by anna"
