"""The robot moves into a soft patient: with hand, forearm or elbow, at one speed, seen or not."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from common.link.config import LinkConfig
from common.quaternion import Array
from common.skeleton import Skeleton, load_skeleton
from deploy.sim.patient.operator import Moves, OperatedRobot
from deploy.sim.patient.patient import in_the_way
from deploy.sim.patient.robot import STEPS, Imperfect, TouchingRobot
from slave.config import SlaveConfig
from slave.contact.config import ContactConfig, ContactJoint, Reflex
from slave.servos.mujoco.simulated import CYCLE_NS

JOINT = "right_shoulder_pitch"
MEETS_RAD = 0.7
"""How far the joint has turned when it meets the patient."""
PUSHES_M = 0.25
"""The operator sees nothing, and goes on so far."""
WATCHES_S = 1.5
ALIGNED_S = 1.0
_SPEEDS_UP_RAD_S2 = 12.0
_STEP_S = CYCLE_NS * 1e-9 / STEPS
UNSEEN_NM = 10_000.0


@dataclass(frozen=True, slots=True)
class Place:
    """A point of the arm, and its distance from the shoulder's axis."""

    segment: str
    local_m: tuple[float, float, float]
    lever_m: float


PLACES = {
    "hand": Place("right_hand", (0.0, 0.0, -0.06), 0.62),
    "forearm": Place("right_forearm", (0.0, 0.0, -0.13), 0.43),
    "elbow": Place("right_forearm", (0.0, 0.0, 0.0), 0.30),
}


@dataclass(frozen=True, slots=True)
class Impact:
    """What came of one meeting."""

    speed_m_s: float
    """Of the point that touched."""
    peak_n: float
    touching_s: float
    """Time in contact, of `WATCHES_S`."""
    pressing_n: float
    """Mean force over the last 0.2 s."""
    noticed_s: float | None
    """From the first touch to the protective stop; None: not noticed."""
    crossed_s: float | None
    """From the first touch until the true torque was beyond a joint's threshold; None: never."""
    went_back_m: float
    """How far the point is at the end behind where it was foremost."""


def contact_config(skeleton: Skeleton, reflex: Reflex | None) -> ContactConfig:
    """The usual one with a reflex; None: no joint's threshold can be reached, and drives push as they can."""
    if reflex is not None:
        return ContactConfig(reflex=reflex)
    unseen = dict.fromkeys(skeleton.joint_names, ContactJoint(threshold_nm=UNSEEN_NM))
    return ContactConfig(joints=unseen, torque_limit=False)


def meet(
    place: Place, speed_m_s: float, *, clamped: bool, reflex: Reflex | None, imperfect: Imperfect
) -> Impact:
    """One meeting with a patient that is free to move or `clamped`. `reflex` None: nobody watches."""
    skeleton = load_skeleton("nursing")
    robot = TouchingRobot(skeleton, imperfect)
    robot.segment, robot.local_m = place.segment, np.array(place.local_m)
    config = SlaveConfig(robot="robot-1", link=LinkConfig(), contact=contact_config(skeleton, reflex))
    run = OperatedRobot(config, robot, swing(skeleton, place, speed_m_s))
    run.run(0.5)
    if (why := run.engage()) is not None:
        raise RuntimeError(f"the robot does not engage: {why}")
    run.since_ns = run.now_ns
    joint = skeleton.joint_names.index(JOINT)
    run.run(ALIGNED_S + 5.0, until=lambda: bool(robot.position_rad[joint] >= MEETS_RAD))
    point_m, velocity_m_s = robot.point()
    speed = float(np.linalg.norm(velocity_m_s))
    towards = velocity_m_s / speed
    robot.patient = in_the_way(point_m, velocity_m_s, clamped=clamped)
    return _watch(run, speed, towards)


def swing(skeleton: Skeleton, place: Place, speed_m_s: float) -> Moves:
    """The shoulder stands, then turns evenly through the place of the meeting and stops beyond it."""
    joint, rate = skeleton.joint_names.index(JOINT), speed_m_s / place.lever_m
    most_rad = MEETS_RAD + PUSHES_M / place.lever_m
    speeds_up_s = rate / _SPEEDS_UP_RAD_S2
    even_s = most_rad / rate - speeds_up_s
    rest = np.clip(np.zeros(len(skeleton.joints)), skeleton.lower_rad, skeleton.upper_rad)

    def moves(t_s: float) -> tuple[Array, Array]:
        t = t_s - ALIGNED_S
        up, even = np.clip(t, 0.0, speeds_up_s), np.clip(t - speeds_up_s, 0.0, even_s)
        down = np.clip(t - speeds_up_s - even_s, 0.0, speeds_up_s)
        position, velocity = rest.copy(), np.zeros_like(rest)
        velocity[joint] = _SPEEDS_UP_RAD_S2 * (up - down)
        position[joint] += _SPEEDS_UP_RAD_S2 * (0.5 * up**2 - 0.5 * down**2) + rate * (even + down)
        return position, velocity

    return moves


def _watch(run: OperatedRobot, speed_m_s: float, towards: Array) -> Impact:
    robot, guard = run.robot, run.pipeline.guard
    ahead: list[float] = []
    stopped_s: float | None = None
    reach_nm_n = np.abs(robot.torques_of(towards))
    threshold_nm = run.pipeline.contact.least_threshold_nm.copy()
    begin_ns = run.now_ns
    while run.now_ns - begin_ns < WATCHES_S * 1e9:
        run.tick()
        ahead.append(float(robot.point()[0] @ towards))
        if stopped_s is None and guard.counters.losses["contact"]:
            stopped_s = len(robot.forces_n) * _STEP_S
    force = np.array(robot.forces_n)
    touching = force > 0.0
    first_s = int(touching.argmax()) * _STEP_S if touching.any() else math.inf
    beyond = (force[:, None] * reach_nm_n > threshold_nm).any(axis=1)
    return Impact(
        speed_m_s,
        peak_n=float(force.max()),
        touching_s=float(touching.sum()) * _STEP_S,
        pressing_n=float(force[-round(0.2 / _STEP_S) :].mean()),
        noticed_s=None if stopped_s is None else stopped_s - first_s,
        crossed_s=int(beyond.argmax()) * _STEP_S - first_s if beyond.any() else None,
        went_back_m=max(ahead) - ahead[-1],
    )
