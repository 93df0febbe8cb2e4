"""What must keep coming, at the boundary of its time-out, with its watch and without it."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from common.skeleton import load_skeleton
from common.wire.messages import Action
from slave.guard import GuardConfig, State
from slave.guard.body import WELL, Body
from slave.guard.watchdog import ARRIVAL_WATCHES, BODY_WATCHES

MakeRig = Callable[..., Any]
JOINTS = load_skeleton("nursing").joint_names
MOVING = [State.ALIGN, State.TRACK]


def without(name: str) -> Any:
    return [watch for watch in ARRIVAL_WATCHES if watch.name != name]


@pytest.mark.parametrize("state", sorted(MOVING))
def test_commands_may_be_silent_up_to_the_time_out_and_no_longer(rig: Any, state: State) -> None:
    rig.to(state)
    assert rig.send().accepted
    for _ in range(40):
        rig.step()
    assert rig.guard.state is not State.HOLD
    rig.step(1)
    assert rig.guard.state is State.HOLD
    assert rig.guard.reason == "no command for 0.20 s"
    assert rig.guard.counters.losses == {"command": 1}


def test_without_its_watch_a_silent_master_is_followed_until_the_lease_ends(
    make_rig: MakeRig,
) -> None:
    rig = make_rig(arrival_watches=without("command")).to_track()
    assert rig.send().accepted
    for _ in range(200):
        rig.step()
    assert rig.guard.state is State.TRACK
    rig.step(1)
    assert rig.guard.state is State.HOLD
    assert "lease" in rig.guard.reason


def test_without_either_watch_it_would_be_followed_for_ever(make_rig: MakeRig) -> None:
    rig = make_rig(arrival_watches=()).to_track()
    rig.run(5.0, commands=False)
    assert rig.guard.state is State.TRACK


def test_a_lease_that_lapses_holds_by_itself(make_rig: MakeRig) -> None:
    config = GuardConfig(command_timeout_s=1.0, lease_timeout_s=1.0, encoder_timeout_s=0.05)
    rig = make_rig(config, arrival_watches=without("command")).to_track()
    rig.run(1.1, commands=False)
    assert rig.guard.counters.losses == {"lease": 1}


@pytest.mark.parametrize("state", sorted(MOVING))
def test_commands_may_lack_a_valid_joint_up_to_the_time_out(rig: Any, state: State) -> None:
    rig.to(state)
    assert rig.send().accepted
    nobody = np.zeros(rig.joints, np.bool_)
    for _ in range(2):
        for _ in range(20):
            rig.step()
        assert rig.send(valid=nobody).accepted
    assert rig.guard.state is not State.HOLD
    rig.step(1)
    assert rig.guard.state is State.HOLD
    assert rig.guard.reason.startswith("no joint has been valid for 0.20 s")
    assert rig.guard.counters.losses == {"valid": 1}
    rig.run(0.3)
    assert rig.guard.state is State.HOLD  # heard again is not engaged
    rig.engage()


def test_one_valid_joint_is_somebody(rig: Any) -> None:
    rig.to_track()
    one = np.zeros(rig.joints, np.bool_)
    one[3] = True
    rig.run(0.5, valid=one)
    assert rig.guard.state is State.TRACK


def test_without_its_watch_a_suit_heard_again_would_move_the_robot(make_rig: MakeRig) -> None:
    rig = make_rig(arrival_watches=without("valid")).to_track()
    rig.run(5.0, valid=np.zeros(rig.joints, np.bool_))
    rig.run(0.1)
    assert rig.guard.state is State.TRACK


def test_every_joint_stops_when_commands_stop(rig: Any) -> None:
    """A watchdog that covers half the robot would leave the other half under way."""
    rig.to_track()
    rig.target = rig.skeleton.lower_rad.copy()
    rig.send()
    rig.run(0.05, commands=False)
    assert (rig.setpoints[-1].velocity_rad_s != 0.0).all()
    rig.run(0.5, commands=False)
    assert (rig.setpoints[-1].velocity_rad_s == 0.0).all()
    still = rig.setpoints[-1].position_rad
    rig.run(1.0, commands=False)
    assert np.array_equal(rig.setpoints[-1].position_rad, still)


@pytest.mark.parametrize("ahead_ms", [0, 15, 22])
def test_a_senders_stamp_does_not_keep_a_command_alive(rig: Any, ahead_ms: int) -> None:
    rig.to_track()
    assert rig.send(sampled_ns=rig.now_ns + ahead_ms * 1_000_000).accepted
    for _ in range(40):
        rig.step()
    assert rig.guard.state is State.TRACK
    rig.step(1)
    assert rig.guard.state is State.HOLD


def test_a_command_after_a_gap_does_not_hide_the_gap(rig: Any) -> None:
    """The loop stalled: the command that comes first afterwards is judged after the watchdog."""
    rig.to_track()
    rig.send()
    rig.now_ns += 200_000_001
    assert rig.send().accepted
    assert rig.guard.state is State.HOLD


def test_a_command_in_time_but_read_late_hides_nothing(rig: Any) -> None:
    rig.to_track()
    rig.send()
    arrived_ns = rig.now_ns + 80_000_000
    rig.now_ns += 250_000_000
    rig.sequence += 1
    assert rig.give(rig.command(), arrived_ns).accepted
    assert rig.guard.state is State.TRACK
    rig.step(30_000_001)
    assert rig.guard.state is State.HOLD


def test_a_request_after_a_gap_does_not_hide_the_gap(rig: Any) -> None:
    rig.to_track()
    rig.now_ns += 300_000_000
    assert rig.ask(Action.STATUS).guard == State.HOLD


@pytest.mark.parametrize("joint", range(len(JOINTS)), ids=JOINTS)
@pytest.mark.parametrize("fault", ["flag", "nan"])
def test_one_lost_encoder_holds_the_whole_robot(rig: Any, joint: int, fault: str) -> None:
    rig.to_track()
    rig.coupled = False
    rig.measured = rig.measured.copy()
    if fault == "flag":
        rig.encoder_valid[joint] = False
    else:
        rig.measured[joint] = np.nan
    rig.run(0.05)
    assert rig.guard.state is State.TRACK
    rig.run(0.005)
    assert rig.guard.state is State.HOLD
    assert JOINTS[joint] in rig.guard.reason
    assert rig.guard.counters.losses == {"encoder": 1}


@pytest.mark.parametrize(
    ("body", "loss", "words"),
    [
        (Body(drives={"neck_yaw": "over-temperature"}), "drive", "the drive of neck_yaw: over-temperature"),
        (Body(base="tilts by 12.0°, limit 10.0°"), "base", "tilts by 12.0°"),
    ],
)
@pytest.mark.parametrize("state", sorted(MOVING))
def test_a_body_that_is_not_well_holds_the_whole_robot_at_once(
    rig: Any, state: State, body: Body, loss: str, words: str
) -> None:
    rig.to(state)
    rig.body = body
    rig.step()
    assert rig.guard.state is State.HOLD
    assert words in rig.guard.reason
    assert rig.guard.counters.losses == {loss: 1}
    rig.body = WELL
    rig.run(1.0)
    assert rig.guard.state is State.HOLD  # mended is not engaged
    rig.engage()


@pytest.mark.parametrize("body", [Body(drives={"neck_yaw": "hot"}), Body(base="tilts")])
def test_without_its_watch_a_sick_body_would_go_on(make_rig: MakeRig, body: Body) -> None:
    watches = tuple(w for w in BODY_WATCHES if w.name not in ("drive", "base"))
    rig = make_rig(body_watches=watches).to_track()
    rig.body = body
    rig.run(0.5)
    assert rig.guard.state is State.TRACK


@pytest.mark.parametrize("sign", [1, -1])
def test_stale_encoders_hold_at_the_boundary(rig: Any, sign: int) -> None:
    """Also readings that claim to come from the future."""
    rig.to_track()
    rig.encoder_delay_ns = sign * 50_000_000
    rig.step()
    assert rig.guard.state is State.TRACK
    rig.encoder_delay_ns = sign * 50_000_001
    rig.step()
    assert rig.guard.state is State.HOLD


def test_one_bad_reading_among_good_ones_is_tolerated(rig: Any) -> None:
    rig.to_track()
    for _ in range(20):
        rig.encoder_valid[3] = not rig.encoder_valid[3]
        rig.run(0.02)
    assert rig.guard.state is State.TRACK


def test_without_its_watch_lost_encoders_would_not_be_noticed(make_rig: MakeRig) -> None:
    rig = make_rig(body_watches=()).to_track()
    rig.encoder_valid[:] = False
    rig.run(0.5)
    assert rig.guard.state is State.TRACK


@pytest.mark.parametrize("step_s", [-3600, 3600])
def test_an_own_clock_that_is_stepped_holds_and_does_not_jump(rig: Any, step_s: int) -> None:
    rig.to_track()
    rig.target = rig.skeleton.lower_rad.copy()
    rig.run(0.1)
    before = rig.setpoints[-1]
    rig.now_ns += step_s * 1_000_000_000
    after = rig.step()
    assert rig.guard.state is State.HOLD
    assert rig.guard.operator == ""
    moved = np.abs(after.position_rad - before.position_rad)
    assert (moved <= np.abs(before.velocity_rad_s) * rig.config.max_step_s).all()
    rig.run(4.0, commands=False)
    assert not rig.ask(Action.ENGAGE).done
    assert rig.claim().done
    rig.run(0.1)
    rig.engage()
    rig.run(0.1)
    assert rig.guard.state is State.ALIGN


@pytest.mark.parametrize("state", sorted(MOVING))
def test_after_a_loss_only_engage_moves_again_and_through_align(rig: Any, state: State) -> None:
    rig.to(state)
    rig.run(0.3, commands=False)
    assert rig.guard.state is State.HOLD
    rig.run(1.0)
    assert rig.guard.state is State.HOLD
    rig.engage()


def test_a_lost_lease_is_not_regained_by_sending_on(rig: Any) -> None:
    rig.to_track()
    rig.run(1.1, commands=False)
    rig.run(1.0)
    assert rig.guard.operator == ""
    assert rig.guard.counters.dropped["lease"] > 0
    assert not rig.ask(Action.ENGAGE).done
    assert rig.claim().done
    assert rig.guard.state is State.HOLD
    rig.run(0.1)
    assert rig.guard.state is State.HOLD


def test_a_lease_counts_from_arrival_too(rig: Any) -> None:
    rig.to_leased()
    rig.now_ns += 90_000_000
    rig.sequence += 1
    assert rig.give(rig.command(), rig.now_ns - 80_000_000).accepted
    rig.now_ns += 920_000_000
    assert not rig.claim("ben").done
    rig.now_ns += 1
    assert rig.claim("ben").done


def test_an_arrival_stamp_from_the_future_counts_as_now(rig: Any) -> None:
    rig.to_track()
    rig.sequence += 1
    assert rig.give(rig.command(), rig.now_ns + 150_000_000).accepted
    for _ in range(40):
        rig.step()
    rig.step(1)
    assert rig.guard.state is State.HOLD


def test_a_command_read_after_the_lease_has_lapsed_does_not_revive_it(rig: Any) -> None:
    """It arrived in time, but the loop stalled until the lease was over."""
    rig.to_leased()
    rig.send()
    arrived_ns = rig.now_ns + 900_000_000
    rig.now_ns += 1_000_000_001
    rig.sequence += 1
    assert rig.give(rig.command(), arrived_ns).gate == "lease"
    assert rig.guard.operator == ""


def test_an_own_clock_that_goes_back_by_less_than_the_lease_holds_too(rig: Any) -> None:
    rig.to_track()
    rig.send()
    rig.step(-200_000_000)
    assert rig.guard.state is State.TRACK
    rig.send()
    rig.step(-200_000_001)
    assert rig.guard.state is State.HOLD
    assert rig.guard.operator == "anna"
