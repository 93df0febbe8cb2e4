"""Short stories of what the guard must do, one for each thing that keeps a robot safe.

Each is named after what it is about and raises AssertionError where the guard lets it happen.
`test_mutants.py` takes that thing away and asks that its story notices: what is added to the guard without a
story here fails there.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from typing import Any

import numpy as np

from common.clock_sync import Offset
from common.wire.messages import Action, BaseAttitude
from deploy.measure.apart import Distances
from slave.guard import GuardConfig, State, tilt
from slave.guard.body import Body
from slave.limit import damper
from tests.slave.limit.apart import CROSSED

MakeRig = Callable[..., Any]
Scenario = Callable[[MakeRig], None]
SCENARIOS: dict[str, Scenario] = {}
KEY = "a key kept at the robot"
ELBOW = 6


def about(*names: str) -> Callable[[Scenario], Scenario]:
    """Enter a story under the names of what it is about."""

    def enter(scenario: Scenario) -> Scenario:
        SCENARIOS.update(dict.fromkeys(names, scenario))
        return scenario

    return enter


def refused(**changes: Any) -> Scenario:
    """A command with something changed is not accepted by a robot that tracks."""

    def scenario(make_rig: MakeRig) -> None:
        rig = make_rig().to_track()
        rig.sequence += 1
        assert not rig.give(rig.command(**{key: make(rig) for key, make in changes.items()})).accepted

    return scenario


# gates

about("gate robot")(refused(robot=lambda _: "robot-2"))
about("gate lease")(refused(lease=lambda rig: rig.lease + 1))
about("gate valid")(refused(position_rad=lambda rig: np.full(rig.joints, np.nan)))
about("gate sequence")(refused(sequence=lambda rig: rig.sequence - 1))
about("gate age", "Situation.age_ns")(refused(sampled_ns=lambda rig: rig.now_ns - 299_000_000))
about("gate future")(refused(sampled_ns=lambda rig: rig.now_ns + 23_000_000))


@about("gate clock")
def clock(make_rig: MakeRig) -> None:
    rig = make_rig().to_track()
    rig.offset = Offset(rig.offset.offset_ns, rig.offset.bound_ns, trusted=False)
    assert not rig.send().accepted


@about("gate deadman")
def deadman(make_rig: MakeRig) -> None:
    rig = make_rig().to_track()
    rig.send(deadman_held=False)
    assert rig.guard.state is State.HOLD


# watches


@about("watch command")
def silence(make_rig: MakeRig) -> None:
    rig = make_rig().to_track()
    rig.run(0.3, commands=False)
    assert rig.guard.state is State.HOLD


@about("watch lease")
def lease_lapses_first(make_rig: MakeRig) -> None:
    """A command read late is older than the lease that the one before it renewed; then a clock goes back."""
    rig = make_rig(GuardConfig(command_timeout_s=1.0, lease_timeout_s=1.0)).to_track()
    rig.send()
    rig.sequence += 1
    assert rig.give(rig.command(), rig.now_ns - 80_000_000).accepted
    rig.step(-1_000_000_001)
    assert rig.guard.operator == ""
    assert rig.guard.state is State.HOLD


@about("watch valid")
def nobody_in_the_suit(make_rig: MakeRig) -> None:
    """Commands go on, but no joint in them is valid; then the suit is heard again."""
    rig = make_rig().to_track()
    rig.run(0.4, valid=np.zeros(rig.joints, np.bool_))
    rig.run(0.4)
    assert rig.guard.state is State.HOLD


@about("watch encoder", "EncoderLife.silence")
def encoder_lost(make_rig: MakeRig) -> None:
    rig = make_rig().to_track()
    rig.encoder_valid[ELBOW] = False
    rig.run(0.1)
    assert rig.guard.state is State.HOLD


@about("watch plausible", "EncoderPlausibility.too_many")
def many_liars(make_rig: MakeRig) -> None:
    rig = make_rig().to_track()
    rig.lies = {joint: lambda true: true + 0.2 for joint in range(5)}
    rig.run(0.3)
    assert rig.guard.state is State.HOLD


@about("watch drive")
def drive(make_rig: MakeRig) -> None:
    rig = make_rig().to_track()
    rig.body = Body(drives={"neck_yaw": "hot"})
    rig.step()
    assert rig.guard.state is State.HOLD


@about("watch base", "tilt.base_loss")
def base(make_rig: MakeRig) -> None:
    rig = make_rig().to_track()
    attitude = BaseAttitude(rig.now_ns, 1.0, 1.0, 1.0, math.radians(11.0))
    rig.body = Body(base=tilt.base_loss(attitude, rig.now_ns, rig.config))
    rig.step()
    assert rig.guard.state is State.HOLD


@about("watch video")
def old_picture(make_rig: MakeRig) -> None:
    """The operator sees a picture of a while ago."""
    rig = make_rig().to_track()
    rig.body = Body(video="the operator's newest picture is 3.1 s old, limit 3 s")
    rig.step()
    assert rig.guard.state is State.HOLD


@about("watch contact")
def contact(make_rig: MakeRig) -> None:
    rig = make_rig().to_track()
    rig.body = Body(contact="pushed at left_hand")
    rig.step()
    assert rig.guard.state is State.HOLD
    rig.run(0.3)
    assert "pushed at left_hand" in rig.guard.engage(rig.guard.operator, rig.now_ns)


@about("watch namesake")
def namesake(make_rig: MakeRig) -> None:
    rig = make_rig().to_track()
    rig.body = Body(namesake="another robot bears this name")
    rig.step()
    assert rig.guard.state is State.HOLD
    assert not rig.ask(Action.ENGAGE).done
    rig.body = Body()
    rig.run(0.5)
    assert rig.guard.state is State.HOLD  # it goes on only when a person says so


# emergency stop inputs

PRESSED = Body(stops={"red button": "gpio line STOP: pressed, or its wire is broken"})


@about("Body.estop")
def pressed_in_every_state(make_rig: MakeRig) -> None:
    """Nobody commands, no operator is there, the robot has not even begun: the button stops it anyway."""
    for state in State:
        rig = make_rig().to(state)
        rig.body = PRESSED
        rig.step()
        assert rig.guard.state is State.ESTOP
        rig.body = Body()
        rig.run(0.2)
        assert rig.guard.state is State.ESTOP  # latched
    rig = make_rig().to_track()
    rig.body = PRESSED
    rig.step()
    assert "red button (gpio line STOP: pressed" in rig.guard.reason
    assert not rig.ask(Action.ENGAGE).done


@about("Guard.still_pressed")
def not_reset_while_pressed(make_rig: MakeRig) -> None:
    rig = make_rig().to_track()
    rig.body = PRESSED
    rig.run(0.5)
    reply = rig.ask(Action.RESET, key=KEY)
    assert not reply.done
    assert "release or mend it first" in reply.text
    rig.body = Body()
    rig.run(0.01)
    assert rig.ask(Action.RESET, key=KEY).done


@about("Body.also")
def two_faults_at_once(make_rig: MakeRig) -> None:
    """A drive that differs from its encoder hides neither a pressed button nor another robot of this name."""
    rig = make_rig()
    rig.drive_off_rad = np.zeros(rig.joints)
    rig.step()
    rig.to_leased()
    rig.drive_off_rad[ELBOW] = math.radians(2.1)
    rig.body = Body(namesake="another robot bears this name", stops=PRESSED.stops)
    rig.run(0.5)
    assert rig.guard.state is State.ESTOP
    assert not rig.ask(Action.RESET, key=KEY).done


# times that follow the link


def over_a_line(rig: Any, age_ms: float, count: int, gap_ms: float = 80.0) -> None:
    """Commands of that age when they arrive, one every so often."""
    for _ in range(count):
        for _ in range(round(gap_ms / 5.0)):
            rig.step()
        rig.send(sampled_ns=rig.now_ns - round(age_ms * 1e6))


@about("times.GROWS")
def grows_slowly(make_rig: MakeRig) -> None:
    rig = make_rig().to_track()
    over_a_line(rig, 290.0, 20)
    assert 0 < rig.guard.times.max_age_ns - 300_000_000 <= 20 * 0.02 * 80_000_000


@about("times.REPEATED")
def one_gap(make_rig: MakeRig) -> None:
    rig = make_rig().to_track()
    over_a_line(rig, 10.0, 20)
    over_a_line(rig, 10.0, 1, gap_ms=195.0)
    over_a_line(rig, 10.0, 30)
    assert rig.guard.times.command_timeout_ns == 200_000_000
    assert rig.guard.state is State.TRACK


@about("times.USUAL")
def held_back(make_rig: MakeRig) -> None:
    """An outage of a second, at whose end all that it held back arrives."""
    rig = make_rig().to_track()
    over_a_line(rig, 10.0, 100)
    rig.run(1.0, commands=False)
    assert rig.guard.state is State.HOLD
    rig.claim()
    for late_ms in range(1000, 0, -80):
        rig.send(sampled_ns=rig.now_ns - late_ms * 1_000_000)
    over_a_line(rig, 10.0, 30)
    assert rig.guard.times.max_age_ns == 300_000_000


@about("GuardConfig.age_ceiling_s")
def stretched_ages(make_rig: MakeRig) -> None:
    rig = make_rig().to_track()
    for age_ms in range(100, 900, 2):
        over_a_line(rig, age_ms, 1)
        if not rig.guard.operator:
            rig.claim()
    rig.sequence += 1
    assert not rig.give(rig.command(sampled_ns=rig.now_ns - 599_000_000)).accepted
    assert rig.guard.times.max_age_ns == 600_000_000


@about("GuardConfig.timeout_ceiling_s")
def stretched_gaps(make_rig: MakeRig) -> None:
    rig = make_rig(GuardConfig(lease_timeout_s=5.0, jump_window_rad=4.0)).to_track()
    for gap_ms in range(80, 700, 5):
        over_a_line(rig, 10.0, 3, gap_ms)
        if rig.guard.state is State.HOLD and gap_ms <= 400:
            rig.engage()
    assert rig.guard.state is State.HOLD
    assert rig.guard.times.command_timeout_ns <= 400_000_000


@about("LinkTimes.forget")
def anothers_line(make_rig: MakeRig) -> None:
    rig = make_rig().to_track()
    over_a_line(rig, 290.0, 40)
    assert rig.guard.times.max_age_ns > 300_000_000
    rig.guard.release(rig.now_ns, "gives it back")
    assert rig.claim("ben").done
    assert rig.guard.times.max_age_ns == 300_000_000


# before it moves


def not_engaged(prepare: Callable[[Any], None], operator: str = "anna") -> Scenario:
    def scenario(make_rig: MakeRig) -> None:
        rig = make_rig()
        prepare(rig)
        before = rig.guard.state
        assert not rig.ask(Action.ENGAGE, operator).done
        assert rig.guard.state is before

    return scenario


def sick(rig: Any) -> None:
    rig.to_leased().body = Body(base="tilts")
    rig.run(0.1)


def deaf(rig: Any) -> None:
    rig.to_leased().encoder_valid[ELBOW] = False
    rig.run(0.1)


def braking(rig: Any) -> None:
    rig.to_track()
    rig.target = rig.skeleton.lower_rad.copy()
    rig.run(0.1)
    rig.ask(Action.DISENGAGE)
    rig.send()


def astray(rig: Any) -> None:
    rig.to_leased().lies[ELBOW] = lambda true: true + rig.config.engage_window_rad + 1e-6
    rig.run(0.1)


def doubtful(rig: Any) -> None:
    rig.to_track().lies[ELBOW] = lambda true: true + 0.15
    rig.run(0.3)
    rig.ask(Action.DISENGAGE)
    rig.lies.clear()
    rig.run(0.1)


about("condition _state")(not_engaged(lambda rig: rig.to_track()))
about("condition _holder", "engage.holder_only")(not_engaged(lambda rig: rig.to_leased(), "ben"))
about("condition _command")(not_engaged(lambda rig: rig.to_leased().run(0.25, commands=False)))
about("condition _operator_side")(
    not_engaged(lambda rig: rig.to_leased().run(0.1, doubt="waist: leans by 30°"))
)
about("condition _valid")(
    not_engaged(lambda rig: rig.to_leased().run(0.1, valid=np.zeros(rig.joints, np.bool_)))
)
about("condition _encoder")(not_engaged(deaf))
about("condition _body")(not_engaged(sick))
about("condition _clutch")(
    not_engaged(lambda rig: rig.to_leased().run(0.1, clutch_out=True)),
)
about("condition _rest")(not_engaged(braking))
about("condition _strayed", "JointReadings.strayed")(not_engaged(astray))
about("condition _unsettled", "EncoderPlausibility.unsettled")(not_engaged(doubtful))


# limits


def within_limits(rig: Any, seconds: float) -> None:
    for _ in range(round(seconds / 0.16)):
        before = rig.setpoints[-1]
        for after in rig.run(0.16):
            v = after.velocity_rad_s
            assert (np.abs(v) <= rig.skeleton.max_velocity_rad_s + 1e-9).all()
            gain = rig.skeleton.max_acceleration_rad_s2 * 0.005
            assert (np.abs(v - before.velocity_rad_s) <= gain + 1e-9).all()
            assert (after.position_rad >= rig.skeleton.lower_rad).all()
            assert (after.position_rad <= rig.skeleton.upper_rad).all()
            before = after


@about("rule velocity", "rule acceleration")
def far_target(make_rig: MakeRig) -> None:
    rig = make_rig().to_track()
    rig.target = rig.skeleton.lower_rad.copy()
    within_limits(rig, 0.8)


def never_stopped_by_force(rig: Any) -> None:
    """The setpoint moves by its own speed, also near the limit: it has braked, and is not cut off there."""
    for i in range(100):
        if i % 16 == 0:
            rig.send(velocity_rad_s=rig.skeleton.max_velocity_rad_s.copy())
        before, after = rig.setpoints[-1], rig.step()
        moved = after.position_rad - before.position_rad
        assert np.allclose(moved, after.velocity_rad_s * 0.005, rtol=0.0, atol=1e-9)


@about("rule position")
def target_at_the_limit(make_rig: MakeRig) -> None:
    rig = make_rig().to_track()
    rig.target = rig.skeleton.upper_rad.copy()
    never_stopped_by_force(rig)


@about("MotionLimits.reachable")
def target_beyond(make_rig: MakeRig) -> None:
    """Who reaches beyond what the robot can is aligned where it stands at its limit."""
    rig = make_rig().to_leased()
    rig.target[ELBOW] = rig.skeleton.upper_rad[ELBOW] + 0.3
    rig.engage()
    rig.run(4.0)
    assert rig.guard.state is State.TRACK


@about("SetpointLimiter.stop")
def brakes(make_rig: MakeRig) -> None:
    rig = make_rig().to_track()
    rig.target = rig.skeleton.lower_rad.copy()
    rig.run(0.1)
    rig.ask(Action.DISENGAGE)
    rig.run(0.5, commands=False)
    assert (rig.setpoints[-1].velocity_rad_s == 0.0).all()


@about("StepTime.elapsed_s")
def late_step(make_rig: MakeRig) -> None:
    rig = make_rig().to_track()
    rig.target = rig.target + 0.5
    rig.run(0.1)
    before = rig.setpoints[-1].position_rad
    rig.send()
    moved = np.abs(rig.step(150_000_000).position_rad - before)
    assert (moved <= rig.skeleton.max_velocity_rad_s * rig.config.max_step_s + 1e-9).all()


@about("TrackTarget.finite")
def broken_tracker(make_rig: MakeRig) -> None:
    rig = make_rig().to_track()
    rig.tracker.newest = type(rig.tracker.newest)(np.full(rig.joints, np.nan), np.zeros(rig.joints))
    assert np.isfinite(rig.step().position_rad).all()
    assert rig.guard.state is State.HOLD


# distance


@about("DistanceDamper.limit")
def arms_crossed(make_rig: MakeRig) -> None:
    rig = make_rig().to_track()
    rig.target = CROSSED
    rig.run(1.5)
    course = np.array([setpoint.position_rad for setpoint in rig.setpoints])
    assert Distances(rig.skeleton).own_m(course).min() >= 0.018
    assert rig.guard.state is State.TRACK


@about("DistanceDamper.overdue")
def distances_too_late(make_rig: MakeRig) -> None:
    rig = make_rig().to_track()
    rig.pipeline.motion.damper.clock = itertools.count(0, damper.BUDGET_NS + 1).__next__
    rig.target = rig.target + 0.3
    rig.run(0.3)
    assert rig.guard.state is State.HOLD
    assert "distances were not computed" in rig.guard.reason


# align


@about("AlignProgress.done")
def slow_first(make_rig: MakeRig) -> None:
    rig = make_rig().to_leased()
    rig.target = rig.target + 0.3
    rig.engage()
    for setpoint in rig.run(0.3):
        assert (np.abs(setpoint.velocity_rad_s) <= rig.config.align_velocity_rad_s + 1e-9).all()
    assert rig.guard.state is State.ALIGN


@about("AlignProgress.overdue")
def never_there(make_rig: MakeRig) -> None:
    rig = make_rig(GuardConfig(align_timeout_s=0.5)).to_leased()
    rig.target = rig.target + 0.6
    rig.engage()
    rig.run(0.6)
    assert rig.guard.state is State.HOLD


@about("Pace.tracking")
def slowly_back(make_rig: MakeRig) -> None:
    rig = make_rig().to_track()
    lost = np.ones(rig.joints, np.bool_)
    lost[ELBOW] = False
    rig.target[ELBOW] += 0.5
    rig.run(0.16, valid=lost)
    for setpoint in rig.run(0.4):
        assert abs(setpoint.velocity_rad_s[ELBOW]) <= rig.config.align_velocity_rad_s + 1e-9


@about("Guard._believed")
def lost_joint(make_rig: MakeRig) -> None:
    rig = make_rig().to_track()
    lost = np.ones(rig.joints, np.bool_)
    lost[ELBOW] = False
    held = rig.setpoints[-1].position_rad[ELBOW]
    rig.target = rig.target + 0.3
    rig.run(0.4, valid=lost)
    assert rig.setpoints[-1].position_rad[ELBOW] == held


@about("RestingJoints.rest")
def a_rested_arm_holds(make_rig: MakeRig) -> None:
    rig = make_rig().to_track()
    held = rig.setpoints[-1].position_rad[ELBOW]
    rig.ask(Action.REST, groups=("left_arm",))
    rig.target = rig.target + 0.3
    rig.run(0.4)
    assert rig.setpoints[-1].position_rad[ELBOW] == held


# encoders that lie


@about("EncoderPlausibility.judge", "Past.span")
def liar(make_rig: MakeRig) -> None:
    rig = make_rig().to_track()
    rig.lies[ELBOW] = lambda true: true + 0.15
    rig.run(0.3)
    assert list(rig.guard.doubts) == [rig.skeleton.joint_names[ELBOW]]
    held = rig.setpoints[-1].position_rad[ELBOW]
    rig.target = rig.target + 0.3
    rig.run(0.3)
    assert rig.setpoints[-1].position_rad[ELBOW] == held


@about("EncoderPlausibility._jumps")
def jumper(make_rig: MakeRig) -> None:
    rig = make_rig().to_track()
    turn = iter(range(10**6))
    rig.lies[ELBOW] = lambda true: true + 0.08 * (next(turn) % 2)
    rig.run(0.1)
    assert rig.guard.doubts


@about("EncoderPlausibility.trust")
def mended(make_rig: MakeRig) -> None:
    rig = make_rig()
    doubtful(rig)
    rig.run(0.5)
    rig.engage()
    assert not rig.guard.doubts


# joints that are not where they are said to be, or do not stay there


@about("EncoderAgreement.judge")
def drive_and_encoder_differ(make_rig: MakeRig) -> None:
    rig = make_rig()
    rig.drive_off_rad = np.zeros(rig.joints)
    rig.step()
    rig.to_track()
    rig.drive_off_rad[ELBOW] = math.radians(2.1)
    rig.run(0.02)
    assert rig.guard.state is State.HOLD
    assert not rig.ask(Action.ENGAGE).done


@about("Placement.unplaced")
def never_held_where_nobody_knows(make_rig: MakeRig) -> None:
    rig = make_rig()
    rig.measured = rig.measured.copy()
    rig.measured[ELBOW] = rig.skeleton.upper_rad[ELBOW] + math.radians(8.1)
    assert not rig.step().ready
    assert rig.guard.state is State.BOOT


@about("UncommandedMotion.judge")
def moves_by_itself(make_rig: MakeRig) -> None:
    rig = make_rig().to_leased()
    rig.run(0.6)
    rig.coupled = False
    rig.measured = rig.measured.copy()
    for _ in range(10):  # 30 degrees a second for 50 ms
        rig.measured[ELBOW] += math.radians(30.0) * 0.005
        rig.step()
    assert rig.guard.state is State.ESTOP


@about("UncommandedMotion._for_long")
def moves_against_its_setpoint(make_rig: MakeRig) -> None:
    rig = make_rig().to_track()
    began_ns, begins_rad = rig.now_ns, rig.measured[ELBOW]
    rig.lies[ELBOW] = lambda _: float(begins_rad + 1e-9 * (rig.now_ns - began_ns))  # 1 rad/s
    rig.run(0.11)  # 60 ms until it is astray, and 50
    assert rig.guard.state is State.ESTOP


# who may


@about("Lease.lapse")
def lapsed(make_rig: MakeRig) -> None:
    rig = make_rig().to_leased()
    rig.run(1.1, commands=False)
    assert rig.send().gate == "lease"
    assert rig.claim("ben").done


@about("Lease.claim")
def second_operator(make_rig: MakeRig) -> None:
    rig = make_rig().to_track()
    assert not rig.ask(Action.CLAIM, "ben").done
    assert rig.guard.operator == "anna"


@about("Lease.lapse_offer")
def offer_too_old(make_rig: MakeRig) -> None:
    rig = make_rig().to_track()
    assert rig.ask(Action.HANDOVER, key="ben").done
    rig.run(60.1)
    assert not rig.ask(Action.CLAIM, "ben").done
    assert rig.guard.reason == "ben did not take over in time; waits for anna to engage"


@about("Guard.offer")
def handed_over(make_rig: MakeRig) -> None:
    rig = make_rig().to_track()
    assert rig.ask(Action.HANDOVER, key="ben").done
    assert rig.guard.state is State.HOLD
    assert rig.guard.reason == "anna hands over to ben"
    rig.run(0.5)
    assert rig.claim("ben").done
    assert rig.guard.reason == "ben took over from anna; waits for ben to engage"
    rig.run(0.5)
    assert rig.guard.state is State.HOLD
    assert not rig.ask(Action.ENGAGE, "anna").done
    assert rig.ask(Action.ENGAGE, "ben").done


@about("Lease.withdraw")
def offer_withdrawn(make_rig: MakeRig) -> None:
    rig = make_rig().to_track()
    assert rig.ask(Action.HANDOVER, key="ben").done
    rig.run(0.5)
    rig.engage()
    assert not rig.ask(Action.CLAIM, "ben").done
    assert rig.guard.state is State.ALIGN


@about("Control._no_successor")
def offered_to_nobody_known(make_rig: MakeRig) -> None:
    rig = make_rig().to_track()
    rig.guard.revoke(frozenset({"carl"}), rig.now_ns)
    for to in ("", "anna", "carl"):
        assert not rig.ask(Action.HANDOVER, key=to).done
    assert rig.guard.state is State.TRACK
    for who in ("ben", ""):
        assert not rig.ask(Action.HANDOVER, who, key="ben").done
    assert rig.guard.lease.offered_to == ""


@about("gate revoked")
def revoked_name_is_counted(make_rig: MakeRig) -> None:
    rig = make_rig().to_track()
    rig.guard.revoke(frozenset({"ben"}), rig.now_ns)
    assert rig.send(operator="ben").gate == "revoked"
    assert rig.send().accepted


@about("Guard.revoke")
def revoked_holder(make_rig: MakeRig) -> None:
    rig = make_rig().to_track()
    rig.guard.revoke(frozenset({"anna"}), rig.now_ns)
    assert rig.guard.state is State.HOLD
    assert rig.guard.reason == "the certificate of anna is revoked"
    assert rig.guard.operator == ""


@about("control.revocation")
def revoked_asks(make_rig: MakeRig) -> None:
    rig = make_rig().to_hold()
    rig.guard.revoke(frozenset({"ben"}), rig.now_ns)
    assert not rig.ask(Action.CLAIM, "ben").done
    assert rig.ask(Action.ESTOP, "ben").done


@about("gate operator")
def stolen_token(make_rig: MakeRig) -> None:
    rig = make_rig().to_track()
    assert rig.send(operator="ben").gate == "operator"
    assert rig.send().accepted


@about("control.holder_only")
def somebody_else(make_rig: MakeRig) -> None:
    rig = make_rig().to_track()
    for action in (Action.RELEASE, Action.DISENGAGE):
        assert not rig.ask(action, "ben").done
    assert rig.guard.state is State.TRACK


@about("Challenges.refusal")
def late_engage(make_rig: MakeRig) -> None:
    rig = make_rig().to_leased()
    challenge = rig.ask(Action.STATUS).challenge
    rig.run(2.1)
    assert not rig.ask(Action.ENGAGE, challenge=challenge).done


@about("hmac.compare_digest")
def wrong_key(make_rig: MakeRig) -> None:
    rig = make_rig().to(State.ESTOP)
    assert not rig.ask(Action.RESET, key="wrong").done


# the clutch


@about(f"({State.TRACK}, clutch released)", "Guard._clutch")
def repositions(make_rig: MakeRig) -> None:
    """The operator goes elsewhere with the clutch released: the robot stands, and is still engaged."""
    rig = make_rig().to_track()
    rig.send(clutch_out=True)
    rig.target = rig.target.copy()
    rig.target[ELBOW] += 0.5
    rig.run(0.5, clutch_out=True)
    assert rig.guard.state is State.CLUTCH
    stood_rad = rig.measured.copy()
    rig.run(0.5, clutch_out=True)
    assert (rig.measured == stood_rad).all()


@about(f"({State.ALIGN}, clutch released)")
def repositions_while_it_aligns(make_rig: MakeRig) -> None:
    rig = make_rig().to(State.ALIGN)
    rig.send(clutch_out=True)
    assert rig.guard.state is State.CLUTCH


@about(f"({State.CLUTCH}, clutch pressed again)")
def follows_again(make_rig: MakeRig) -> None:
    """Slowly, and without anybody's engage."""
    rig = make_rig().to(State.CLUTCH)
    rig.send()
    assert rig.guard.state is State.ALIGN
    rig.run(0.5)
    assert rig.guard.state is State.TRACK


@about("watch clutch")
def repositions_for_too_long(make_rig: MakeRig) -> None:
    rig = make_rig(GuardConfig(clutch_max_s=1.0)).to(State.CLUTCH)
    rig.run(1.1, clutch_out=True)
    rig.run(0.5)
    assert rig.guard.state is State.HOLD


# states


@about("(boot, all encoders valid)", "(hold, engage)", "(align, every joint within its window)")
def from_boot_to_track(make_rig: MakeRig) -> None:
    make_rig().to_track()


def ends_motion(state: State, end: Callable[[Any], None]) -> Scenario:
    def scenario(make_rig: MakeRig) -> None:
        rig = make_rig().to(state)
        end(rig)
        assert rig.guard.state is State.HOLD

    return scenario


for _state in (State.ALIGN, State.TRACK, State.CLUTCH):
    about(f"({_state}, disengage)")(ends_motion(_state, lambda rig: rig.ask(Action.DISENGAGE)))
    about(f"({_state}, loss of lease, deadman, command or encoder)")(
        ends_motion(_state, lambda rig: rig.ask(Action.RELEASE))
    )


def stops(state: State) -> Scenario:
    def scenario(make_rig: MakeRig) -> None:
        rig = make_rig().to(state)
        assert rig.ask(Action.ESTOP, "").done
        assert rig.guard.state is State.ESTOP
        for _ in range(20):
            rig.step()
        assert rig.guard.state is State.ESTOP
        assert not rig.ask(Action.ENGAGE).done

    return scenario


for _state in State:
    about(f"({_state}, e-stop)")(stops(_state))


@about("(estop, reset)")
def reset(make_rig: MakeRig) -> None:
    rig = make_rig().to(State.ESTOP)
    assert rig.ask(Action.RESET, key=KEY).done
    assert rig.guard.state is State.HOLD
