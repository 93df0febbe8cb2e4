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

TICK_S = 0.005
_SERVO_RAD_S, _DAMPING = 2.0 * math.pi * 8.0, math.sqrt(0.5)
SERVO_LAG_S = 2.0 * _DAMPING / _SERVO_RAD_S + 0.5 * TICK_S
POSITION_NOISE_DEG, VELOCITY_NOISE_DEG_S = 0.03, 0.2
"""Of the suit's angles beside a slow error, which no strategy can know of."""
_FIRST_S = 0.0023
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


def follow(
    course: ClipSpline, slower: float, skeleton: Skeleton, strategy: str, line: Line, seed: int
) -> Followed:
    """Play a clip so much slower, then let the operator stand still."""
    lasts_s = course.lasts_s * slower
    time_s = np.arange(0.0, lasts_s + STILL_S, TICK_S)
    truth = course(np.minimum(time_s, lasts_s) / slower)
    tracker = make_tracker(TrackConfig(strategy=strategy, servo_lag_s=SERVO_LAG_S))
    limits = _limits(skeleton)
    limiter = SetpointLimiter(skeleton.joint_names, limits)
    limiter.seat(truth[0])
    free = np.zeros(truth.shape[1], np.bool_)
    step, servo = _servo_step(), np.stack([truth[0], np.zeros(truth.shape[1])])
    robot = np.empty_like(truth)
    samples = _samples(course, slower, line, time_s[-1], seed)
    arrival = next(samples, None)
    for k, now_s in enumerate(time_s.tolist()):
        while arrival is not None and arrival[0] <= now_s:
            tracker.accept(to_ns(arrival[1]), to_ns(arrival[0]), arrival[2], arrival[3])
            arrival = next(samples, None)
        target = tracker.target(to_ns(now_s))
        if target is not None:
            limiter.step(
                to_ns(now_s), TICK_S, target.position_rad, target.velocity_rad_s, free,
                limits.max_velocity_rad_s, limits.max_acceleration_rad_s2,
            )  # fmt: skip
        robot[k] = servo[0]
        servo = step @ np.vstack([servo, limiter.position_rad])
    return Followed(truth, robot, int(np.searchsorted(time_s, lasts_s)))


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
