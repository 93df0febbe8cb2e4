"""An operator without a suit: any motion, sent to the robot's pipeline as commands; on a virtual clock."""

from __future__ import annotations

import itertools
from collections.abc import Callable

import numpy as np

from common.clock import NS_PER_MS, NS_PER_S, to_s
from common.clock_sync import Offset
from common.quaternion import Array
from common.wire.messages import Command, CommandStamps
from deploy.sim.patient.robot import TouchingRobot
from slave.config import SlaveConfig
from slave.guard import State
from slave.limit.limit import Setpoint
from slave.pipeline import SlavePipeline

TICK_NS = 5 * NS_PER_MS
COMMAND_TICKS = 16
OPERATOR = "operator"
ONE_CLOCK = Offset(0, 0, trusted=True)

Moves = Callable[[float], tuple[Array, Array]]
"""Angles and rates (J,) at a time, s."""


class OperatedRobot:
    """The slave's own pipeline, a robot, and an operator who holds the lease and moves as he likes."""

    def __init__(self, config: SlaveConfig, robot: TouchingRobot, moves: Moves) -> None:
        self.robot, self.moves = robot, moves
        self.pipeline = SlavePipeline(config, draw_token=itertools.count(1).__next__, instance=1)
        self.now_ns = 0
        self.since_ns = 0
        """When the motion began."""
        self._ticks = 0
        self._lease = 0
        self.setpoint: Setpoint | None = None

    @property
    def state(self) -> State:
        """The guard's."""
        return self.pipeline.guard.state

    def run(self, seconds: float, until: Callable[[], bool] = lambda: False) -> None:
        """Go on for some time, or until a condition holds."""
        end_ns = self.now_ns + round(seconds * NS_PER_S)
        while self.now_ns < end_ns and not until():
            self.tick()

    def engage(self) -> str | None:
        """Engage, and go on until the robot tracks or 15 s are over; or why it refuses."""
        why = self.pipeline.guard.engage(OPERATOR, self.now_ns)
        if why is None:
            self.run(15.0, until=lambda: self.state not in (State.ALIGN,))
        return why

    def tick(self) -> None:
        """One turn of the slave's loop; every 16th a command comes first."""
        guard = self.pipeline.guard
        if self._ticks % COMMAND_TICKS == 0:
            if not guard.operator:
                self._lease = guard.claim(OPERATOR, self.now_ns)
            command = self._command()
            self.pipeline.take(command, self.now_ns, self.now_ns, ONE_CLOCK)
        self.robot.advance(self.now_ns)
        self.setpoint = self.pipeline.tick(self.now_ns, self.robot.read())
        if self.setpoint.ready:
            self.robot.limit_torque(self.setpoint.torque_nm)
            self.robot.write(self.setpoint.position_rad)
        self._ticks += 1
        self.now_ns += TICK_NS

    def _command(self) -> Command:
        position_rad, velocity_rad_s = self.moves(to_s(self.now_ns - self.since_ns))
        stamps = CommandStamps(*[self.now_ns] * 4)
        return Command(
            self.pipeline.robot, self._lease, self._ticks + 1, self._ticks, stamps, True,
            np.ones(len(position_rad), np.bool_), position_rad, velocity_rad_s, operator=OPERATOR,
        )  # fmt: skip
