"""The slave's limiter led by a random operator, each setpoint judged by distances computed another way."""

from __future__ import annotations

import itertools
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from common.quaternion import Array
from deploy.experiments.collisions.operator import WAITS_S, OperatorMove, moves
from deploy.measure.apart import Distances
from slave.config import SlaveConfig
from slave.limit.damper import DistanceDamper
from slave.limit.limit import SetpointLimiter

SLACK_M = 0.002
HOME_RAD = 0.01
_EPS = 1e-9


@dataclass(slots=True)
class CollisionReport:
    """What a run found."""

    kinds: Counter[str] = field(default_factory=Counter)
    """Motions made, by kind."""
    ticks: int = 0
    held_back: int = 0
    """Ticks in which a joint was held back."""
    spare_m: dict[str, float] = field(default_factory=dict)
    """The least distance less its margin, of the robot itself and of each zone that keeps one."""
    beyond_limits: int = 0
    stuck: int = 0
    """Times that the robot did not come home within 4 s of the operator."""
    tick_us: dict[str, float] = field(default_factory=dict)
    """CPU time of a whole step of the limiter: p50, p99, max."""

    @property
    def wrong(self) -> list[str]:
        """What should not have been."""
        wrong = [
            f"{what} came {-1000.0 * spare_m:.1f} mm nearer than its margin"
            for what, spare_m in self.spare_m.items()
            if spare_m < -SLACK_M
        ]
        wrong += [f"limits were exceeded in {self.beyond_limits} ticks"] * bool(self.beyond_limits)
        return wrong + [f"the robot was stuck {self.stuck} times"] * bool(self.stuck)


class CollisionTrial:
    """A robot as a file describes it; `damped` False takes the damper away, which must turn out badly."""

    def __init__(self, config: SlaveConfig, seed: int, damped: bool = True) -> None:
        guard, skeleton = config.guard, config.skeleton
        self.report = CollisionReport()
        self._guard, self._dt_s = guard, 1.0 / config.loop.rate_hz
        self._limits = guard.limits(skeleton)
        self._home = self._limits.reachable(np.zeros(len(skeleton.joints)))
        self._damper = DistanceDamper(skeleton, guard.self_margin_cm, guard.zones) if damped else None
        self._limiter = SetpointLimiter(skeleton.joint_names, self._limits, self._damper)
        self._limiter.seat(self._home)
        self._distances = Distances(skeleton, guard.zones)
        self._moves = moves(seed, skeleton.joint_names, self._limits, self._home, self._dt_s)
        self._spent_ns: list[int] = []

    def run(self, motions: int, going_on: Callable[[], bool] = lambda: True) -> CollisionReport:
        """So many more motions, or as long as `going_on` says."""
        for move in itertools.islice(self._moves, motions):
            if not going_on():
                break
            self._follow(move)
            self.report.kinds[move.kind] += 1
        if self._spent_ns:
            p50, p99, most = np.percentile(self._spent_ns, [50, 99, 100]) / 1000.0
            self.report.tick_us = {"p50": float(p50), "p99": float(p99), "max": float(most)}
        return self.report

    def _follow(self, move: OperatorMove) -> None:
        course = [self._limiter.position_rad]
        for target, rate in zip(move.position_rad, move.velocity_rad_s, strict=True):
            course.append(self._step(target, rate))
        if move.home:
            still = np.zeros_like(self._home)
            for _ in range(round(WAITS_S / self._dt_s)):
                if np.abs(course[-1] - self._home).max() < HOME_RAD:
                    break
                course.append(self._step(self._home, still))
            else:
                self.report.stuck += 1
                self._limiter.seat(self._home)
        self._judge(np.array(course))

    def _step(self, target: Array, rate: Array) -> Array:
        limiter, limits, report = self._limiter, self._limits, self.report
        before, speed = limiter.position_rad, limiter.velocity_rad_s
        held = np.zeros(len(target), np.bool_)
        began_ns = time.thread_time_ns()
        limiter.step(
            0, self._dt_s, target, rate, held, limits.max_velocity_rad_s, limits.max_acceleration_rad_s2
        )
        self._spent_ns.append(time.thread_time_ns() - began_ns)
        q, v = limiter.position_rad, limiter.velocity_rad_s
        report.ticks += 1
        report.held_back += self._damper is not None and bool(self._damper.held_back.any())
        report.beyond_limits += not (
            (np.abs(v) <= limits.max_velocity_rad_s + _EPS).all()
            and (np.abs(v - speed) <= limits.max_acceleration_rad_s2 * self._dt_s + _EPS).all()
            and (limits.reachable(q) == q).all()
            and np.allclose(q - before, v * self._dt_s, rtol=0.0, atol=_EPS)
        )
        return q

    def _judge(self, course: Array) -> None:
        """The setpoints, and midway between each two."""
        whole = np.vstack([course, 0.5 * (course[1:] + course[:-1])])
        spare = {"the robot": self._distances.own_m(whole).min() - self._guard.self_margin_cm / 100.0}
        to_zones = self._distances.to_zones_m(whole).min(axis=0)
        for zone, least_m in zip(self._guard.zones, to_zones.tolist(), strict=True):
            if not zone.enter:
                spare[zone.name] = least_m - zone.margin_m
        for what, spare_m in spare.items():
            self.report.spare_m[what] = min(self.report.spare_m.get(what, np.inf), float(spare_m))
