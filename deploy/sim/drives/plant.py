"""What the drives turn: the simulated robot, each joint's demand interpolated, braked or held. Pure."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from common.clock import NS_PER_S
from common.quaternion import Array
from common.skeleton import Skeleton
from common.wire.messages import Mask
from slave.encoders.counts import EncoderConfig, Encoders
from slave.servos.mujoco.simulated import CYCLE_NS, SimulatedRobot

_AT_REST_RAD_S = 1e-6
MOST_CYCLES = 25
"""A process held up for longer than these 100 ms does not catch up in a burst."""
LATEST_CYCLES = 5
"""Angles of longer ago are not made up."""


class Plant:
    """All joints, on the drives' own 4 ms cycle."""

    def __init__(
        self,
        skeleton: Skeleton,
        encoders: EncoderConfig,
        origin_ns: int,
        position_rad: Array | None = None,
        *,
        each_cycle: Callable[[Array, Array], None] = lambda effort_nm, velocity_rad_s: None,
    ) -> None:
        """`each_cycle`: gets efforts and velocities of the demand (J,) after every cycle."""
        self._each_cycle = each_cycle
        self._robot = SimulatedRobot(skeleton, encoders, origin_ns, position_rad)
        self._encoders = Encoders(skeleton, encoders)
        self._demand = self._robot.position_rad
        self._velocity = np.zeros(len(self._demand))
        self._from, self._to = self._demand.copy(), self._demand.copy()
        self._since_ns = np.full(len(self._demand), origin_ns, np.int64)
        self._period_ns = np.full(len(self._demand), NS_PER_S // 50, np.int64)
        self._follows = np.zeros(len(self._demand), np.bool_)
        self.ramp_rad_s2 = skeleton.max_acceleration_rad_s2.copy()
        """(J,) how hard each brakes."""
        self.window_rad = np.full(len(self._demand), np.inf)
        """(J,) following error allowed."""
        self.beyond_ns = np.zeros(len(self._demand), np.int64)
        """(J,) for how long each has been further off."""

    @property
    def position_rad(self) -> Array:
        """Where the joints are, (J,)."""
        return self._robot.position_rad

    def seen_rad(self, now_ns: int) -> Array:
        """(J,) where the joints are at a moment of this cycle, or were before: drives sample on SYNC.

        A SYNC that this process reads late was still sampled when it arrived.
        """
        since_ns = min(max(-LATEST_CYCLES * CYCLE_NS, now_ns - self._robot.now_ns), CYCLE_NS)
        out: Array = self._robot.position_rad + self._robot.velocity_rad_s * (since_ns / NS_PER_S)
        return out

    def counts(self, position_rad: Array) -> NDArray[np.int64]:
        """What the encoders show, (J,)."""
        return self._encoders.counts(position_rad)

    @property
    def effort_nm(self) -> Array:
        """(J,) torque at the joints."""
        return self._robot.effort_nm

    @property
    def moving(self) -> Mask:
        """(J,) whose demand moves."""
        out: Mask = np.abs(self._velocity) > _AT_REST_RAD_S
        return out

    def follow(self, joint: int, target_rad: float, period_ns: int, now_ns: int) -> None:
        """From its demand to a target, evenly within a period."""
        self._from[joint], self._to[joint] = self._demand[joint], target_rad
        self._since_ns[joint], self._period_ns[joint] = now_ns, period_ns
        self._follows[joint] = True

    def limit_torque(self, torque_nm: Array) -> None:
        """Least and greatest torque (2, J) of the motors, N m at the joint."""
        self._robot.limit_torque(torque_nm)

    def brake(self, joint: int) -> None:
        """Stop by the ramp, then hold."""
        self._follows[joint] = False

    def advance(self, now_ns: int) -> None:
        """Run every cycle that ends by `now_ns`; stand still for what lies further back than MOST_CYCLES."""
        dt_s = CYCLE_NS / NS_PER_S
        due = (now_ns - self._robot.now_ns) // CYCLE_NS
        if due > MOST_CYCLES:
            self._robot.resume(self._robot.now_ns + (due - MOST_CYCLES) * CYCLE_NS)
        for _ in range(min(due, MOST_CYCLES)):
            at_ns = self._robot.now_ns + CYCLE_NS
            share = np.clip((at_ns - self._since_ns) / self._period_ns, 0.0, 1.0)
            followed = self._from + (self._to - self._from) * share
            most = self.ramp_rad_s2 * dt_s
            braked = np.sign(self._velocity) * np.maximum(np.abs(self._velocity) - most, 0.0)
            demand = np.where(self._follows, followed, self._demand + braked * dt_s)
            self._velocity = (demand - self._demand) / dt_s
            self._demand = demand
            self._robot.write(demand)
            self._robot.advance(at_ns)
            self._each_cycle(self._robot.effort_nm, self._velocity)
            off = np.abs(self._robot.position_rad - demand) > self.window_rad
            self.beyond_ns = np.where(off, self.beyond_ns + CYCLE_NS, 0)
