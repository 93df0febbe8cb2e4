"""A group that rests holds whatever the operator does, and comes back slowly when it is taken up."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from common.skeleton.groups import joint_groups
from common.wire.messages import Action
from slave.guard import State

ARM = ("left_arm",)


def rest(rig: Any, **changes: Any) -> Any:
    return rig.ask(Action.REST, **{"groups": ARM, **changes})


def take_up(rig: Any, **changes: Any) -> Any:
    return rig.ask(Action.TAKE_UP, **{"groups": ARM, **changes})


def test_its_joints_hold_and_the_others_follow(rig: Any) -> None:
    rig.to_track()
    arm = joint_groups(rig.skeleton)["left_arm"]
    before = rig.setpoints[-1].position_rad
    assert rest(rig).done
    rig.target = rig.target + 0.2
    rig.run(1.0)
    after = rig.setpoints[-1].position_rad
    assert (after[arm] == before[arm]).all()
    assert np.allclose(after[~arm], rig.target[~arm], atol=1e-6)
    assert rig.guard.state is State.TRACK
    assert rig.guard.resting.names == ARM


def test_a_moving_arm_brakes_within_its_limits_when_it_begins_to_rest(rig: Any) -> None:
    rig.to_track()
    rig.target = rig.target + 0.4
    rig.run(0.1)
    assert np.abs(rig.setpoints[-1].velocity_rad_s).max() > 0.5
    assert rest(rig).done
    before = rig.setpoints[-1]
    arm = joint_groups(rig.skeleton)["left_arm"]
    for after in rig.run(0.5):
        change = np.abs(after.velocity_rad_s - before.velocity_rad_s)
        assert (change <= rig.skeleton.max_acceleration_rad_s2 * 0.005 + 1e-9).all()
        before = after
    assert (before.velocity_rad_s[arm] == 0.0).all()


def test_taken_up_it_comes_back_slowly_and_then_follows_at_full_speed(rig: Any) -> None:
    rig.to_track()
    assert rest(rig).done
    rig.target = rig.target + 0.4
    rig.run(0.5)
    arm = joint_groups(rig.skeleton)["left_arm"]
    assert take_up(rig).done
    speeds = [np.abs(after.velocity_rad_s[arm]).max() for after in rig.run(3.0)]
    assert 0.3 < max(speeds) <= rig.config.align_velocity_rad_s + 1e-9
    assert np.allclose(rig.setpoints[-1].position_rad, rig.target, atol=1e-6)
    rig.target = rig.target - 0.4
    speeds = [np.abs(after.velocity_rad_s[arm]).max() for after in rig.run(0.3)]
    assert max(speeds) > 2.0 * rig.config.align_velocity_rad_s


def test_it_rests_through_a_hold_and_an_engage_which_says_so(rig: Any) -> None:
    rig.to_track()
    assert rest(rig).done
    rig.ask(Action.DISENGAGE)
    rig.target = rig.target + 0.2
    rig.run(0.3)
    before = rig.setpoints[-1].position_rad
    reply = rig.ask(Action.ENGAGE)
    assert reply.done
    assert "at rest: left_arm (follow again: tandem take-up left_arm)" in reply.text
    rig.run(2.0)
    assert rig.guard.state is State.TRACK
    arm = joint_groups(rig.skeleton)["left_arm"]
    assert (rig.setpoints[-1].position_rad[arm] == before[arm]).all()


def test_a_hand_still_rests_when_its_arm_is_taken_up(rig: Any) -> None:
    rig.to_track()
    assert rest(rig, groups=("left_arm", "left_hand")).done
    assert take_up(rig).done
    assert (rig.guard.resting.joints == joint_groups(rig.skeleton)["left_hand"]).all()


@pytest.mark.parametrize("act", [rest, take_up])
def test_only_the_holder_of_the_lease_may_ask(rig: Any, act: Any) -> None:
    rig.to_track()
    assert rest(rig).done
    reply = act(rig, operator="ben")
    assert not reply.done
    assert "anna holds the lease" in reply.text
    assert rig.guard.resting.names == ARM


def test_a_take_up_that_the_network_held_back_does_nothing(rig: Any) -> None:
    rig.to_track()
    assert rest(rig).done
    challenge = rig.ask(Action.STATUS).challenge
    rig.run(2.1)
    assert not take_up(rig, challenge=challenge).done
    assert not take_up(rig, challenge=1).done
    assert rig.guard.resting.names == ARM


@pytest.mark.parametrize(
    ("act", "groups", "words"),
    [
        (rest, ("left_leg",), "left_leg is no joint group: nursing has trunk, head, left_arm, "),
        (rest, (), "name at least one joint group: nursing has"),
        (take_up, ("head",), "at rest: left_arm, not head"),
    ],
)
def test_a_group_that_is_none_is_refused_in_words(rig: Any, act: Any, groups: Any, words: str) -> None:
    rig.to_track()
    assert rest(rig).done
    reply = act(rig, groups=groups)
    assert not reply.done
    assert words in reply.text
    assert rig.guard.resting.names == ARM
