"""Random smooth motions of the whole human range: what the robot is told is in reach, continuous, bounded.

Runs `MOTIONS` of them by default, and TANDEM_MOTIONS of each profile where that is set.
Each test of one protection is shown to fail where that protection is taken away.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest

from common.quaternion import Array, conjugate, rotate
from common.reach import follower, step
from common.skeleton import Skeleton, load_skeleton
from master.joint_angles.solver import JointSolver

from .human import body_rates, human_range, in_world, random_motions, relative, turns

MOTIONS = {"nursing": 900, "hand": 1200, "lower_limb": 1500}
"""A motion moves every segment of the profile, each on its own way."""
CHUNK = 1500
STEPS = 16
DT_S = 0.08
GAIN, SLACK_RAD = 1.5, np.radians(2.0)


@dataclass(frozen=True)
class Run:
    """What was asked and told: axes are step, motion, and segment or joint."""

    skeleton: Skeleton
    q: Array
    """Parent from segment (T, M, N, 4)."""
    rate_rad_s: Array
    """How fast each segment turns relative to its neighbour (T, M, N)."""
    position_rad: Array
    velocity_rad_s: Array

    def of_joints(self, of_segments: Array) -> Array:
        """The most among the segments that each joint turns, (..., J)."""
        segments = [
            [self.skeleton.angle_slots[angle][0] for angle in joint.drives] for joint in self.skeleton.joints
        ]
        return np.stack([of_segments[..., each].max(axis=-1) for each in segments], axis=-1)

    def robot(self) -> Array:
        """The robot's rotations, parent from segment (T, M, N, 4)."""
        angles = self.position_rad @ self.skeleton.angles_from_joints.T
        return relative(self.skeleton, angles.reshape(*angles.shape[:-1], -1, 3))


def play(profile: str, count: int, seed: int = 0) -> Run:
    skeleton = load_skeleton(profile)
    angle_rad = random_motions(skeleton, count, STEPS, DT_S, seed)
    return follow(skeleton, angle_rad)


def follow(skeleton: Skeleton, angle_rad: Array) -> Run:
    """The solver's answers to angles (T, M, N, 3); each motion is begun anew."""
    q_relative = relative(skeleton, angle_rad)
    q = in_world(skeleton, q_relative)
    rate = body_rates(q, DT_S)
    shape = (*angle_rad.shape[:2], len(skeleton.joints))
    position, velocity = np.empty(shape), np.empty(shape)
    solver = JointSolver(skeleton)
    for m in range(shape[1]):
        solver.forget()
        for t in range(shape[0]):
            position[t, m], velocity[t, m] = solver.solve(q[t, m], rate[t, m], DT_S)
    speed = np.zeros(angle_rad.shape[:3])
    speed[1:] = np.linalg.norm(_relative_rates(skeleton, q_relative, rate)[1:], axis=-1)
    return Run(skeleton, q_relative, speed, position, velocity)


def _relative_rates(skeleton: Skeleton, q_relative: Array, rate: Array) -> Array:
    out = rate.copy()
    for i, parent in enumerate(skeleton.parents):
        if parent >= 0:
            out[..., i, :] -= rotate(conjugate(q_relative[..., i, :]), rate[..., parent, :])
    return out


def within_limits(run: Run) -> None:
    low, high = run.skeleton.lower_rad, run.skeleton.upper_rad
    assert np.isfinite(run.velocity_rad_s).all()
    assert np.all((low <= run.position_rad) & (run.position_rad <= high))


def no_joint_jumps(run: Run) -> None:
    step = np.abs(np.diff(run.position_rad, axis=0))
    assert np.max(step - GAIN * run.of_joints(turns(run.q))) <= SLACK_RAD


def no_segment_jumps(run: Run) -> None:
    coupled = {a for j in run.skeleton.joints if len(j.drives) > 1 for a in j.drives}
    own = [i for i, s in enumerate(run.skeleton.segments) if any(a and a not in coupled for a in s.angles)]
    excess = turns(run.robot()) - GAIN * turns(run.q)
    assert np.max(excess[..., own]) <= SLACK_RAD


def no_joint_is_told_to_race(run: Run) -> None:
    allowed = 3.0 * run.of_joints(run.rate_rad_s)
    assert np.max(np.abs(run.velocity_rad_s) - allowed) <= 1e-9


CHECKS = [within_limits, no_joint_jumps, no_segment_jumps, no_joint_is_told_to_race]


@pytest.mark.parametrize("profile", MOTIONS)
@pytest.mark.long
def test_of_every_motion(profile: str) -> None:
    count = int(os.environ.get("TANDEM_MOTIONS", MOTIONS[profile]))
    done = 0
    while done < count:
        run = play(profile, min(CHUNK, count - done), seed=done)
        for check in CHECKS:
            check(run)
        done += run.q.shape[1]
    sys.stdout.write(f"{profile}: {done} motions of {STEPS} postures, {DT_S} s apart\n")


def test_where_the_robot_can_take_the_posture_it_does() -> None:
    """From any posture to any other within the limits, the poles' neighbourhood included, and then a rest."""
    skeleton = load_skeleton("nursing")
    rng = np.random.default_rng(4)
    count, moving, resting = 60, 16, 160
    ends = rng.uniform(skeleton.lower_rad, skeleton.upper_rad, (2, count, len(skeleton.joints)))
    u = np.concatenate([np.linspace(0.0, 1.0, moving), np.ones(resting)])[:, None, None]
    joints = ends[0] + (ends[1] - ends[0]) * (u**3 * (10.0 + u * (6.0 * u - 15.0)))
    angles = (joints @ skeleton.angles_from_joints.T).reshape(*joints.shape[:2], -1, 3)
    run = follow(skeleton, angles)
    for check in CHECKS:
        check(run)
    np.testing.assert_allclose(run.position_rad[-1], ends[1], atol=1e-9)
    # nor is it much behind on the way, but for the arms near their poles
    shoulders = [j for j, name in enumerate(skeleton.joint_names) if "shoulder" in name]
    others = np.delete(run.position_rad - joints, shoulders, axis=-1)
    np.testing.assert_allclose(others, 0.0, atol=1e-9)


def test_back_from_the_end_of_range_the_robot_is_where_it_was() -> None:
    """Out of reach and back the same way: each segment to the end of the human range, one axis at a time."""
    for profile in MOTIONS:
        skeleton = load_skeleton(profile)
        low, high = human_range(skeleton)
        rng = np.random.default_rng(6)
        reachable = rng.uniform(skeleton.lower_rad, skeleton.upper_rad) * 0.5
        start = (skeleton.angles_from_joints @ reachable).reshape(-1, 3)
        u = np.concatenate([np.linspace(0.0, 1.0, 30), np.ones(10), np.linspace(1.0, 0.0, 30), np.zeros(40)])
        ways = []
        for axis in range(3):
            for end in (low, high):
                target = start.copy()
                target[:, axis] = end[:, axis]
                ways.append(start + (target - start) * u[:, None, None])
        run = follow(skeleton, np.stack(ways, axis=1))
        no_joint_jumps(run)
        np.testing.assert_allclose(run.position_rad[-1], np.tile(reachable, (len(ways), 1)), atol=1e-9)


MUTANTS: dict[str, tuple[Callable[[pytest.MonkeyPatch], None], Callable[[Run], None]]] = {
    "no limits": (
        lambda m: m.setattr(follower.PostureFollower, "_project", lambda *_: None),
        lambda run: nearest_at_rest(run),
    ),
    "no bound of the joints' steps": (
        lambda m: m.setattr(step.BoundedStep, "limit", lambda *_: None),
        no_joint_jumps,
    ),
    "no bound of the segments' turns": (
        lambda m: m.setattr(step.BoundedStep, "limit_turn", lambda *_: None),
        no_segment_jumps,
    ),
    "no bound of the told speed": (
        lambda m: m.setattr(follower, "MOST_GAIN", 1e9),
        no_joint_is_told_to_race,
    ),
}


def nearest_at_rest(run: Run) -> None:
    """A motion's first posture is begun anew: no random posture within the limits is nearer."""
    skeleton, rng = run.skeleton, np.random.default_rng(7)
    own = [i for i, s in enumerate(skeleton.segments) if sum(bool(a) for a in s.angles) > 1]
    joints = rng.uniform(skeleton.lower_rad, skeleton.upper_rad, (20_000, len(skeleton.joints)))
    joints = np.where(rng.uniform(size=joints.shape) < 0.2, skeleton.lower_rad, joints)
    joints = np.where(rng.uniform(size=joints.shape) < 0.2, skeleton.upper_rad, joints)
    others = relative(skeleton, (joints @ skeleton.angles_from_joints.T).reshape(len(joints), -1, 3))
    for i in own:
        if skeleton.parents[i] < 0:
            continue  # faces anywhere
        told = np.abs(np.einsum("mi,mi->m", run.robot()[0, :, i], run.q[0, :, i]))
        best = np.abs(run.q[0, :, i] @ others[:, i].T).max(axis=1)
        assert np.all(told >= best - 1e-12), skeleton.segment_names[i]


@pytest.mark.parametrize("profile", MOTIONS)
def test_the_first_posture_is_the_nearest_there_is(profile: str) -> None:
    nearest_at_rest(play(profile, 300, seed=9))


@pytest.mark.parametrize("mutant", MUTANTS.values(), ids=MUTANTS)
def test_without_a_protection_its_test_fails(
    mutant: tuple[Callable[[pytest.MonkeyPatch], None], Callable[[Run], None]],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    take_away, check = mutant
    take_away(monkeypatch)
    mutated = play("nursing", 150)
    with pytest.raises(AssertionError):
        check(mutated)
