"""Hard reaches for the tracker tests: samples late and noisy, the guard's limits, a servo; no clock.

`python -m tests.slave.track.reaches` prints the table of slave/track/README.md.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Literal, get_args

import numpy as np

from common.clock import to_ns
from common.quaternion import Array
from slave.guard.limits import MotionLimits
from slave.limit.limit import SetpointLimiter
from slave.track.config import TrackConfig, make_tracker
from slave.track.tracker import Tracker

TICK_S = 0.005
_SERVO_HZ, _SERVO_DAMPING = 8.0, math.sqrt(0.5)
SERVO_LAG_S = 2.0 * _SERVO_DAMPING / (2.0 * math.pi * _SERVO_HZ) + TICK_S / 2.0
"""Of the servo below behind a ramp, and half a tick for which a setpoint stands on average."""

Strategy = Literal["latest", "interpolate", "predict"]


@dataclass(frozen=True, slots=True)
class World:
    """What happens to the operator, the samples and the robot; angles in degrees, as read by people."""

    seed: int = 1
    seconds: float = 30.0
    joints: int = 25
    reach_deg: tuple[float, float] = (30.0, 60.0)
    reach_s: tuple[float, float] = (0.5, 1.2)
    pause_s: tuple[float, float] = (0.3, 1.2)
    period_s: float = 0.08
    transit_s: tuple[float, float] = (0.008, 0.015)
    position_noise_deg: float = 0.2
    velocity_noise_deg_s: float = 1.5
    velocity_known: bool = True
    max_velocity_deg_s: float = 240.0
    max_acceleration_deg_s2: float = 2500.0
    """Limits of the guard behind the tracker: those of a shoulder."""


@dataclass(frozen=True, slots=True)
class Run:
    """Truth and robot at the same instants, (T, J) rad, T ticks of 5 ms."""

    truth_rad: Array
    target_rad: Array
    target_rad_s: Array
    robot_rad: Array
    clamps: int
    """Times that the guard's limiter began to clamp a joint."""


@dataclass(frozen=True, slots=True)
class Figures:
    """As the report of `tandem demo` has them."""

    rmse_deg: float
    lag_ms: float
    aligned_rmse_deg: float
    roughness: float
    clamps_per_joint_s: float


@dataclass(slots=True)
class Operator:
    """Minimum-jerk reaches (Flash and Hogan 1985) to and fro, with pauses; each joint for itself."""

    world: World
    reaches: list[Array] = field(default_factory=list)
    """Per joint (K, 4): start s, duration s, from rad, by rad."""

    def __post_init__(self) -> None:
        rng = np.random.default_rng(self.world.seed)
        for _ in range(self.world.joints):
            reaches, start_s, place = [], rng.uniform(0.0, 1.0), rng.uniform(-20.0, 20.0)
            while start_s < self.world.seconds + 1.0:
                duration_s = rng.uniform(*self.world.reach_s)
                by = math.copysign(rng.uniform(*self.world.reach_deg), -place)
                reaches.append([start_s, duration_s, math.radians(place), math.radians(by)])
                start_s += duration_s + rng.uniform(*self.world.pause_s)
                place += by
            self.reaches.append(np.array(reaches))

    def at(self, time_s: Array) -> tuple[Array, Array]:
        """Position and velocity, (T, J) each, at times (T,)."""
        position, velocity = np.empty((2, len(time_s), len(self.reaches)))
        for j, reaches in enumerate(self.reaches):
            row = np.maximum(np.searchsorted(reaches[:, 0], time_s) - 1, 0)
            start_s, duration_s, place, by = reaches[row].T
            x = np.clip((time_s - start_s) / duration_s, 0.0, 1.0)
            position[:, j] = place + by * x**3 * (10.0 + x * (6.0 * x - 15.0))
            velocity[:, j] = by / duration_s * 30.0 * (x * (1.0 - x)) ** 2
        return position, velocity


def tracker_for(strategy: Strategy) -> Tracker:
    """The strategy with its defaults, told the lag of this module's servo."""
    return make_tracker(TrackConfig(strategy=strategy, servo_lag_s=SERVO_LAG_S))


def run(tracker: Tracker, world: World) -> Run:
    """Samples at their arrival into the tracker; its target through the guard's limits to the servo."""
    operator = Operator(world)
    time_s = np.arange(0.0, world.seconds, TICK_S)
    truth, _ = operator.at(time_s)
    samples = _samples(operator, world)
    arrival_s, sample = next(samples)
    limiter = _limiter(world, truth[0])
    step = _servo_step()
    servo = np.stack([truth[0], np.zeros(world.joints)])
    target_rad, target_rad_s, robot_rad = np.empty((3, *truth.shape))
    clamps = 0
    for k, now_s in enumerate(time_s.tolist()):
        while arrival_s <= now_s:
            tracker.accept(to_ns(sample[0]), to_ns(arrival_s), sample[1], sample[2])
            arrival_s, sample = next(samples)
        target = tracker.target(to_ns(now_s))
        goal = (truth[0], np.zeros(world.joints))
        if target is not None:
            goal = (target.position_rad, target.velocity_rad_s)
            limits, free = limiter.limits, np.zeros(world.joints, np.bool_)
            clamps += len(
                limiter.step(
                    to_ns(now_s), TICK_S, *goal, free,
                    limits.max_velocity_rad_s, limits.max_acceleration_rad_s2,
                )
            )  # fmt: skip
        target_rad[k], target_rad_s[k] = goal
        robot_rad[k] = servo[0]
        servo = step @ np.vstack([servo, limiter.position_rad])
    return Run(truth, target_rad, target_rad_s, robot_rad, clamps)


def figures(done: Run) -> Figures:
    """Judge a run, without its first and last two seconds."""
    inner = slice(round(2.0 / TICK_S), -round(2.0 / TICK_S))
    robot = np.rad2deg(done.robot_rad)
    truth = np.rad2deg(done.truth_rad)
    shifts = np.arange(-30, 60)
    errors = np.array([_rms((robot - np.roll(truth, s, axis=0))[inner]) for s in shifts])
    best = int(np.argmin(errors[1:-1])) + 1
    before, here, after = errors[best - 1 : best + 2] ** 2
    between = 0.5 * (before - after) / (before - 2.0 * here + after)
    ticks, joints = truth.shape
    return Figures(
        rmse_deg=_rms((robot - truth)[inner]),
        lag_ms=1e3 * TICK_S * float(shifts[best] + between),
        aligned_rmse_deg=float(errors[best]),
        roughness=_rms(_acceleration(robot)[inner]) / _rms(_acceleration(truth)[inner]),
        clamps_per_joint_s=done.clamps / (joints * ticks * TICK_S),
    )


def _samples(operator: Operator, world: World) -> Iterator[tuple[float, tuple[float, Array, Array]]]:
    """Arrival, then capture time, position and velocity, for ever."""
    rng = np.random.default_rng(world.seed + 1)
    sampled_s = 0.013
    while True:
        position, velocity = (a[0] for a in operator.at(np.array([sampled_s])))
        position = position + np.deg2rad(rng.normal(0.0, world.position_noise_deg, world.joints))
        velocity = velocity + np.deg2rad(rng.normal(0.0, world.velocity_noise_deg_s, world.joints))
        yield (
            sampled_s + rng.uniform(*world.transit_s),
            (sampled_s, position, velocity if world.velocity_known else np.zeros(world.joints)),
        )
        sampled_s += world.period_s


def _limiter(world: World, position_rad: Array) -> SetpointLimiter:
    one = np.ones(world.joints)
    limits = MotionLimits(
        -math.pi * one,
        math.pi * one,
        math.radians(world.max_velocity_deg_s) * one,
        math.radians(world.max_acceleration_deg_s2) * one,
    )
    limiter = SetpointLimiter([f"joint_{j}" for j in range(world.joints)], limits)
    limiter.seat(position_rad)
    return limiter


def _servo_step() -> Array:
    """(2, 3): position and velocity of x'' = ω² (u - x) - 2 ζ ω x' one tick on, u held. ζ < 1."""
    omega = 2.0 * math.pi * _SERVO_HZ
    sigma, damped = _SERVO_DAMPING * omega, omega * math.sqrt(1.0 - _SERVO_DAMPING**2)
    fade = math.exp(-sigma * TICK_S)
    c, s = fade * math.cos(damped * TICK_S), fade * math.sin(damped * TICK_S) / damped
    free = np.array([[c + sigma * s, s], [-(omega**2) * s, c - sigma * s]])
    return np.column_stack([free, np.array([1.0, 0.0]) - free[:, 0]])


def _acceleration(position: Array) -> Array:
    """Second difference, after a zero-phase low-pass of 10 Hz (a Butterworth forth and back)."""
    ramp = np.linspace(position[0], position[-1], len(position))
    gain = 1.0 / (1.0 + (np.fft.rfftfreq(len(position), TICK_S) / 10.0) ** 4)
    spectrum = np.fft.rfft(position - ramp, axis=0) * gain[:, None]
    out: Array = np.diff(np.fft.irfft(spectrum, n=len(position), axis=0) + ramp, n=2, axis=0) / TICK_S**2
    return out


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def main() -> None:
    """Print the figures of every strategy, in the default world."""
    row = "{:12} {:>10} {:>8} {:>12} {:>11} {:>18}\n"
    sys.stdout.write(row.format("strategy", "RMSE °", "lag ms", "aligned °", "roughness", "clamps /joint /s"))
    for strategy in get_args(Strategy):
        f = figures(run(tracker_for(strategy), World()))
        numbers = (f.rmse_deg, f.lag_ms, f.aligned_rmse_deg, f.roughness, f.clamps_per_joint_s)
        sys.stdout.write(row.format(strategy, *(f"{n:.2f}" for n in numbers)))


if __name__ == "__main__":
    main()
