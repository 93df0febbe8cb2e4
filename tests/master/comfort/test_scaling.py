"""Scaled motion begins where the operator engages or takes an arm up, and never jumps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.skeleton import load_skeleton
from common.skeleton.groups import joint_groups
from common.wire.messages import Action
from deploy.sim.world.world import WorldSettings
from master.comfort.scaling import MotionScaling, scaling_mistakes
from tests.whole_way.runs import engaged

NURSING = load_skeleton("nursing")
ARM = joint_groups(NURSING)["left_arm"]
J = len(NURSING.joints)
ALL = np.ones(J, np.bool_)
RATE = np.full(J, 0.8)


def at(rad: float) -> np.ndarray:
    return np.full(J, rad)


def scaling(**factors: float) -> MotionScaling:
    return MotionScaling(factors or {"left_arm": 0.5}, NURSING)


def test_until_the_robot_follows_the_posture_is_the_operator_s_own() -> None:
    subject = scaling()
    for rad in (0.1, 0.5):
        subject.on_state("hold", ())
        position, velocity = subject.scale(at(rad), RATE, ALL)
        assert (position == rad).all()
        assert (velocity == RATE).all()


@pytest.mark.parametrize("guard", ["align", "track"])
def test_from_the_engage_on_the_group_turns_by_its_share(guard: str) -> None:
    subject = scaling()
    subject.on_state("hold", ())
    subject.scale(at(0.3), RATE, ALL)
    subject.on_state(guard, ())
    first, _ = subject.scale(at(0.3), RATE, ALL)
    assert (first == 0.3).all(), "no jump as the factor begins to count"
    position, velocity = subject.scale(at(0.7), RATE, ALL)
    assert position[ARM] == pytest.approx(0.5)
    assert velocity[ARM] == pytest.approx(0.4)
    assert (position[~ARM] == 0.7).all()
    assert (velocity[~ARM] == 0.8).all()


def test_a_group_that_rested_scales_about_the_posture_in_which_it_is_taken_up() -> None:
    subject = scaling()
    subject.on_state("track", ())
    subject.scale(at(0.0), RATE, ALL)
    subject.on_state("track", ("left_arm",))
    assert (subject.scale(at(1.0), RATE, ALL)[0] == 1.0).all()
    subject.on_state("track", ())
    assert (subject.scale(at(1.0), RATE, ALL)[0] == 1.0).all()
    assert subject.scale(at(1.2), RATE, ALL)[0][ARM] == pytest.approx(1.1)


def test_a_joint_whose_node_was_lost_keeps_its_anchor_and_takes_none_while_it_is_lost() -> None:
    subject = scaling()
    subject.on_state("track", ())
    subject.scale(at(0.2), RATE, ~ARM)
    assert (subject.scale(at(0.4), RATE, ALL)[0] == 0.4).all(), "its first valid posture is its anchor"
    lost, _ = subject.scale(at(0.0), at(0.0), ~ARM)
    assert (lost == 0.0).all()
    assert subject.scale(at(0.6), RATE, ALL)[0][ARM] == pytest.approx(0.5)


def test_a_hand_has_its_own_factor_within_its_arm_s() -> None:
    hand = joint_groups(NURSING)["left_hand"]
    for factors in ({"left_arm": 0.5, "left_hand": 1.0}, {"left_hand": 1.0, "left_arm": 0.5}):
        subject = scaling(**factors)
        subject.on_state("track", ())
        subject.scale(at(0.0), RATE, ALL)
        position, _ = subject.scale(at(1.0), RATE, ALL)
        assert (position[hand] == 1.0).all()
        assert (position[ARM & ~hand] == 0.5).all()


@given(st.floats(0.1, 1.0), st.floats(0.0, 1.0), st.floats(0.0, 1.0))
def test_what_the_operator_keeps_of_the_limits_the_scaled_joint_keeps(f: float, a: float, q: float) -> None:
    subject = scaling(left_arm=f)
    low, high = NURSING.lower_rad, NURSING.upper_rad
    subject.on_state("track", ())
    subject.scale(low + a * (high - low), RATE, ALL)
    position, velocity = subject.scale(low + q * (high - low), RATE, ALL)
    assert (position >= low - 1e-9).all()
    assert (position <= high + 1e-9).all()
    assert (np.abs(velocity) <= RATE).all()


def test_a_group_that_is_none_is_named() -> None:
    (mistake,) = scaling_mistakes({"left_leg": 0.5, "head": 0.5}, NURSING)
    assert mistake.key == "operator.scaling.left_leg"
    assert "trunk, head, left_arm" in mistake.expected


@pytest.mark.long
def test_the_whole_way_the_robot_s_arm_makes_half_of_the_operator_s_motion() -> None:
    overrides = {"master": ["operator.scaling={right_arm=0.5}"]}
    run = engaged(replace(WorldSettings(), overrides=overrides))
    first = len(run.states)
    speeds: list[float] = []
    run.inject.watch = lambda _, setpoint: speeds.append(float(np.abs(setpoint.velocity_rad_s).max()))
    run.run(8.0)
    elbow = NURSING.joint_names.index("right_elbow_pitch")
    truth = run.trace.truth().position_rad[-1600:, elbow]
    moved = np.ptp([state.position_rad[elbow] for state in run.states[first:]])
    assert np.ptp(truth) > 0.5
    assert moved == pytest.approx(0.5 * np.ptp(truth), rel=0.1)
    assert run.ask(Action.DISENGAGE).done
