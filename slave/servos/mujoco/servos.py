"""The simulated robot in real time: its physics runs in a thread of its own, off the event loop's back."""

from __future__ import annotations

import threading
import time
from collections.abc import Mapping

from common.clock import Clock, monotonic_ns, to_s
from common.errors import RobotError
from common.metrics.slave import ServoMetrics
from common.quaternion import Array
from common.skeleton import Skeleton
from slave.encoders.counts import EncoderConfig
from slave.servos.mujoco.simulated import CYCLE_NS, SimulatedRobot
from slave.servos.servos import EncoderReading

_JOIN_S = 1.0


class MujocoServos:
    """Servos (see `slave.servos.Servos`) of a MuJoCo robot that lives in this process.

    One thread runs the physics up to now every 4 ms; MuJoCo gives the interpreter lock back while it
    steps. Setpoint and reading are each one reference, replaced whole, so neither side ever waits.
    The drives hold the last setpoint by themselves, for as long as no other is written.
    """

    def __init__(
        self, skeleton: Skeleton, encoders: EncoderConfig | None = None, clock: Clock = monotonic_ns
    ) -> None:
        self._clock = clock
        self._robot = SimulatedRobot(skeleton, encoders, clock())
        self._reading = self._robot.read()
        self._running = False
        self._thread: threading.Thread | None = None

    @property
    def skipped_cycles(self) -> int:
        """Drive cycles lost because the machine held the thread up for more than 20 ms."""
        return self._robot.skipped_cycles

    def start(self) -> None:
        """Let the physics run. Raises RobotError when it runs already."""
        if self._thread is not None:
            raise RobotError("the simulated robot runs already: stop it before it is started again")
        self._robot.resume(self._clock())
        self._running = True
        self._thread = threading.Thread(target=self._run, name="mujoco", daemon=True)
        self._thread.start()

    def write(self, position_rad: Array) -> None:
        """Hand over setpoints (J,), taken in at the drives' next cycle. Raises ValueError if not finite."""
        self._robot.write(position_rad)

    @property
    def no_torque_limit(self) -> Mapping[str, str]:
        """See `LimitsTorque`: every simulated drive takes it."""
        return {}

    def limit_torque(self, torque_nm: Array | None) -> None:
        """Limit the motors from their next cycle on. See `slave.servos.LimitsTorque`."""
        self._robot.limit_torque(torque_nm)

    def read(self) -> EncoderReading:
        """The reading of the newest cycle."""
        return self._reading

    def faults(self) -> Mapping[str, str]:
        """None: a simulated drive is well, or the physics has diverged, and then no encoder is valid."""
        return {}

    def quick_stop(self, stop: bool) -> None:
        """Nothing to be done here: the guard's setpoint brakes, and these drives only follow it."""

    def metrics(self) -> ServoMetrics:
        """Cycles that the machine has cost it."""
        return ServoMetrics(counters={"skipped_cycles": self.skipped_cycles})

    def stop(self) -> None:
        """End the thread; the robot stays where it is, and its setpoint with it."""
        self._running = False
        if self._thread is not None:
            self._thread.join(_JOIN_S)
            self._thread = None

    def _run(self) -> None:
        robot = self._robot
        while self._running:
            wait_ns = robot.now_ns + CYCLE_NS - self._clock()
            if wait_ns > 0:
                time.sleep(to_s(wait_ns))
            robot.advance(self._clock())
            self._reading = robot.read()
