"""One clip followed over one line: samples ▸ tracker ▸ limiter ▸ servo, without a clock, a suit or MuJoCo.

The servo is x'' = ω² (u - x) - 2 ζ ω x' with 8 Hz and ζ = 0.71; its lag, 28 ms, and half a tick are what
`predict` is told.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from common.clock import to_ns
from common.quaternion import Array
from common.skeleton import Skeleton
from deploy.sim.suit.people import ClipSpline
from slave.guard.limits import MotionLimits
from slave.limit.limit import SetpointLimiter
from slave.track.config import TrackConfig, make_tracker
from slave.track.tracker import Tracker

TICK_S = 0.005
_SERVO_RAD_S, _DAMPING = 2.0 * math.pi * 8.0, math.sqrt(0.5)
SERVO_LAG_S = 2.0 * _DAMPING / _SERVO_RAD_S + 0.5 * TICK_S
POSITION_NOISE_DEG, VELOCITY_NOISE_DEG_S = 0.03, 0.2
"""Of the suit's angles beside a slow error, which no strategy can know of."""
_FIRST_S = 0.0023
FOREKNOWN = "foreknown"
"""No strategy: the targets are what the operator will really do. What is left is the joints' limits."""
STILL_S = 3.0
"""After a clip the operator stands still for so long."""


@dataclass(frozen=True, slots=True)
class Line:
    """A link and how it is used."""

    one_way_s: float
    rate_hz: float = 12.5
    jitter_s: float = 0.0
    """Standard deviation of a normal delay beyond `one_way_s`, of which only the size counts."""
    loss: float = 0.0
    velocities: bool = True


@dataclass(frozen=True, slots=True)
class Followed:
    """Operator and robot at the same instants, (T, J) rad every TICK_S."""

    truth_rad: Array
    robot_rad: Array
    still: int
    """From this row on the operator stands still."""
    unlimited_rad: Array
    """Where the robot would be if its joints had no limits of speed and acceleration."""


def follow(
    course: ClipSpline, slower: float, skeleton: Skeleton, strategy: str, line: Line, seed: int
) -> Followed:
    """Play a clip so much slower, then let the operator stand still."""
    lasts_s = course.lasts_s * slower
    time_s = np.arange(0.0, lasts_s + STILL_S, TICK_S)
    truth = course(np.minimum(time_s, lasts_s) / slower)
    if strategy == FOREKNOWN:
        targets = _foreknown(course, slower, time_s)
    else:
        tracker = make_tracker(TrackConfig(strategy=strategy, servo_lag_s=SERVO_LAG_S))
        targets = _tracked(tracker, truth[0], time_s, _samples(course, slower, line, time_s[-1], seed))
    robot, unlimited = _moved(_limited(targets, skeleton)), _moved(targets[0])
    return Followed(truth, robot, int(np.searchsorted(time_s, lasts_s)), unlimited)


def _foreknown(course: ClipSpline, slower: float, time_s: Array) -> Array:
    """(2, T, J) position and velocity of the operator by the time that the servos are there."""
    lasts_s = course.lasts_s * slower
    then_s = time_s + SERVO_LAG_S
    own_s = np.minimum(then_s, lasts_s) / slower
    return np.stack([course(own_s), course(own_s, 1) / slower * (then_s < lasts_s)[:, None]])


def _tracked(
    tracker: Tracker, start_rad: Array, time_s: Array, samples: Iterator[tuple[float, float, Array, Array]]
) -> Array:
    """(2, T, J) position and velocity of the tracker's targets."""
    targets = np.empty((2, len(time_s), len(start_rad)))
    arrival = next(samples, None)
    for k, now_s in enumerate(time_s.tolist()):
        while arrival is not None and arrival[0] <= now_s:
            tracker.accept(to_ns(arrival[1]), to_ns(arrival[0]), arrival[2], arrival[3])
            arrival = next(samples, None)
        target = tracker.target(to_ns(now_s))
        if target is None:
            targets[0, k], targets[1, k] = start_rad, 0.0
        else:
            targets[0, k], targets[1, k] = target.position_rad, target.velocity_rad_s
    return targets


def _limited(targets: Array, skeleton: Skeleton) -> Array:
    """(T, J) what the guard's limiter makes of (2, T, J)."""
    limits = _limits(skeleton)
    limiter = SetpointLimiter(skeleton.joint_names, limits)
    limiter.seat(targets[0, 0])
    free = np.zeros(targets.shape[2], np.bool_)
    out: Array = np.empty_like(targets[0])
    for k, (position, velocity) in enumerate(targets.swapaxes(0, 1)):
        limiter.step(
            k, TICK_S, position, velocity, free, limits.max_velocity_rad_s, limits.max_acceleration_rad_s2
        )
        out[k] = limiter.position_rad
    return out


def _moved(setpoint_rad: Array) -> Array:
    """(T, J) what the servos make of setpoints: where they are as each is written."""
    step = _servo_step()
    out: Array = np.empty_like(setpoint_rad)
    servo = np.stack([setpoint_rad[0], np.zeros(setpoint_rad.shape[1])])
    for k, setpoint in enumerate(setpoint_rad):
        out[k] = servo[0]
        servo = step @ np.vstack([servo, setpoint])
    return out


def _samples(
    course: ClipSpline, slower: float, line: Line, end_s: float, seed: int
) -> Iterator[tuple[float, float, Array, Array]]:
    """Arrival and capture, s, position and velocity of each sample that comes, by arrival."""
    lasts_s = course.lasts_s * slower
    taken_s = np.arange(_FIRST_S, end_s, 1.0 / line.rate_hz)
    own_s = np.minimum(taken_s, lasts_s) / slower
    position = course(own_s)
    velocity = course(own_s, 1) / slower * (taken_s < lasts_s)[:, None]
    random = np.random.default_rng([seed, round(line.rate_hz * 10)])
    position = position + np.radians(POSITION_NOISE_DEG) * random.standard_normal(position.shape)
    velocity = velocity + np.radians(VELOCITY_NOISE_DEG_S) * random.standard_normal(velocity.shape)
    late_s = np.abs(random.normal(0.0, 1.0, len(taken_s))) * line.jitter_s
    arrives_s = taken_s + line.one_way_s + late_s
    lost = random.random(len(taken_s)) < line.loss
    for n in np.argsort(arrives_s, kind="stable").tolist():
        if not lost[n]:
            yield arrives_s[n], taken_s[n], position[n], velocity[n] * line.velocities


def _limits(skeleton: Skeleton) -> MotionLimits:
    joints = skeleton.joints
    return MotionLimits(
        skeleton.lower_rad,
        skeleton.upper_rad,
        np.array([joint.max_velocity_rad_s for joint in joints]),
        np.array([joint.max_acceleration_rad_s2 for joint in joints]),
    )


def _servo_step() -> Array:
    """(2, 3): position and velocity one tick on, from them and a setpoint that is held."""
    sigma, damped = _DAMPING * _SERVO_RAD_S, _SERVO_RAD_S * math.sqrt(1.0 - _DAMPING**2)
    fade = math.exp(-sigma * TICK_S)
    c, s = fade * math.cos(damped * TICK_S), fade * math.sin(damped * TICK_S) / damped
    free = np.array([[c + sigma * s, s], [-(_SERVO_RAD_S**2) * s, c - sigma * s]])
    return np.column_stack([free, np.array([1.0, 0.0]) - free[:, 0]])
