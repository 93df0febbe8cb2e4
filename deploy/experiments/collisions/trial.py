"""The slave's limiter led by a random operator, each setpoint judged by distances computed another way."""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Iterator

import numpy as np

from common.quaternion import Array
from deploy.experiments.collisions.operator import COMMANDS_PER_S, HOME, RandomGoal, motions
from deploy.experiments.collisions.report import CollisionReport
from deploy.measure.apart import Distances
from slave.config import SlaveConfig
from slave.limit.damper import DistanceDamper
from slave.limit.limit import SetpointLimiter

WAITS_S = 4.0
HOME_RAD = 0.01
FOLLOWS_RAD = 0.05
"""An operator who leads the robot back waits until it is this near."""
JUDGED_TOGETHER = 64
"""Ticks."""
TIMED_EVERY = 16
"""Steps: asking how much CPU time one took is no small part of it on some systems."""
_EPS = 1e-9


class CollisionTrial:
    """A robot as a file describes it; `damped` False takes the damper away, which must turn out badly."""

    def __init__(self, config: SlaveConfig, damped: bool = True) -> None:
        guard, skeleton = config.guard, config.skeleton
        self._names, self._guard, self._dt_s = skeleton.joint_names, guard, 1.0 / config.loop.rate_hz
        self._limits = guard.limits(skeleton)
        self._home = self._limits.reachable(np.zeros(len(skeleton.joints)))
        self._held = np.zeros(len(self._home), np.bool_)
        self._damper = DistanceDamper(skeleton, guard.self_margin_cm, guard.zones) if damped else None
        self._limiter = SetpointLimiter(skeleton.joint_names, self._limits, self._damper)
        self._distances = Distances(skeleton, guard.zones)
        self._begin_at_home()

    def run(
        self, seed: int, part: int, count: int, going_on: Callable[[], bool] = lambda: True
    ) -> CollisionReport:
        """So many motions from home, or as long as `going_on` says; every part of a seed is another."""
        self._begin_at_home()
        rng = np.random.default_rng((seed, part))
        for motion in itertools.islice(motions(rng, self._names, self._limits, self._home), count):
            if not going_on():
                break
            self._follow(motion)
            self.report.kinds[motion.kind] += 1
        self._judge()
        return self.report

    def _begin_at_home(self) -> None:
        self.report = CollisionReport()
        self._limiter.seat(self._home)
        self._way: list[Array] = [self._home]
        """Setpoints since the robot was at home."""
        self._course = [(self._home, np.zeros_like(self._home))]
        """Setpoints and their velocities that are not judged yet."""

    def _follow(self, motion: RandomGoal) -> None:
        if motion.kind == HOME:
            self._go_home()
            return
        for tick in range(round(1.0 / (COMMANDS_PER_S * self._dt_s))):
            ahead = tick * self._dt_s * motion.velocity_rad_s
            self._step(motion.position_rad + ahead, motion.velocity_rad_s)
        if motion.line_dies:
            self.report.stops += 1
            while not self._limiter.at_rest:
                self._limiter.stop(self._dt_s)
                self._took_step()

    def _go_home(self) -> None:
        if not self._came_to(itertools.repeat(self._home, round(WAITS_S / self._dt_s))):
            self.report.stuck += 1
            self.report.trapped += not self._led_back()
        if np.abs(self._limiter.position_rad - self._home).max() >= HOME_RAD:
            self._judge()
            self._limiter.seat(self._home)
            self._course = [(self._home, np.zeros_like(self._home))]
        self._way = [self._limiter.position_rad]

    def _came_to(self, goals: Iterator[Array]) -> bool:
        still = np.zeros_like(self._home)
        for goal in goals:
            self._step(goal, still)
            if np.abs(self._limiter.position_rad - self._home).max() < HOME_RAD:
                return True
        return False

    def _led_back(self) -> bool:
        """Whether the robot follows, when its own way is shown to it backwards."""
        return self._came_to(self._backwards(self._way[::-1]))

    def _backwards(self, way: list[Array]) -> Iterator[Array]:
        waits = round(WAITS_S / self._dt_s)
        for goal in (*way, self._home):
            for _ in range(waits):
                yield goal
                if np.abs(self._limiter.position_rad - goal).max() < FOLLOWS_RAD:
                    break
            else:
                return
        yield from itertools.repeat(self._home, waits)

    def _step(self, target: Array, rate: Array) -> None:
        limits = self._limits
        timed = self.report.ticks % TIMED_EVERY == 0
        began_ns = time.thread_time_ns() if timed else 0
        self._limiter.step(
            0, self._dt_s, target, rate, self._held, limits.max_velocity_rad_s, limits.max_acceleration_rad_s2
        )
        if timed:
            self.report.took([(time.thread_time_ns() - began_ns) / 1000.0])
        self.report.held_back += self._damper is not None and bool(self._damper.held_back.any())
        self._took_step()

    def _took_step(self) -> None:
        self.report.ticks += 1
        self._way.append(self._limiter.position_rad)
        self._course.append((self._limiter.position_rad, self._limiter.velocity_rad_s))
        if len(self._course) > JUDGED_TOGETHER:
            self._judge()

    def _judge(self) -> None:
        """All setpoints since the last time, and the way between each two."""
        q, v = (np.array(part) for part in zip(*self._course, strict=True))
        self._course = self._course[-1:]
        if len(q) < 2:
            return
        limits, report = self._limits, self.report
        most = limits.max_velocity_rad_s + _EPS, limits.max_acceleration_rad_s2 * self._dt_s + _EPS
        kept = (np.abs(v[1:]) <= most[0]) & (np.abs(np.diff(v, axis=0)) <= most[1])
        kept &= (q[1:] >= limits.lower_rad) & (q[1:] <= limits.upper_rad)
        kept &= np.abs(np.diff(q, axis=0) - v[1:] * self._dt_s) <= _EPS
        report.beyond_limits += int((~kept.all(axis=1)).sum())
        own_m, zones_m = self._distances.on_the_way_m(q)
        report.came("the robot", own_m - self._guard.self_margin_cm / 100.0)
        for zone, least_m in zip(self._guard.zones, zones_m, strict=True):
            if not zone.enter:
                report.came(zone.name, least_m - zone.margin_m)
