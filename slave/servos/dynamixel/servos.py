"""The servos' bus in a thread of its own: the serial port never holds up the 200 Hz loop."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping

from common.clock import Clock, monotonic_ns, to_s
from common.errors import RobotError
from common.metrics.slave import ServoMetrics
from common.quaternion import Array
from common.skeleton import Skeleton
from slave.encoders.counts import EncoderConfig
from slave.servos.dynamixel.config import DynamixelConfig
from slave.servos.dynamixel.driver import Driver
from slave.servos.dynamixel.port import Port
from slave.servos.servos import EncoderReading, check_setpoint

_JOIN_S = 3.0


class DynamixelServos:
    """Servos (see `slave.servos.Servos`) of the DYNAMIXEL X series on one serial bus.

    Setpoint and reading are each one reference, replaced whole: the newest counts, no side waits.
    """

    def __init__(
        self,
        config: DynamixelConfig,
        skeleton: Skeleton,
        encoders: EncoderConfig | None = None,
        clock: Clock = monotonic_ns,
        open_port: Callable[[str, int, float], Port] = Port,
    ) -> None:
        self._clock = clock
        self._period_ns = round(1e9 / config.rate_hz)
        self._driver = Driver(config, skeleton, encoders or EncoderConfig(), clock, open_port)
        self._count = len(skeleton.joints)
        self._setpoint: Array | None = None
        self._stop = False
        self._recover = False
        self._ended = threading.Event()
        self._thread: threading.Thread | None = None
        self.late_cycles = 0
        """Cycles that were left out because one before took too long."""

    def start(self) -> None:
        """Make the servos ready, holding where they stand. Raises RobotError naming those that are not."""
        if self._thread is not None:
            raise RobotError("the servos run already: stop them before they are started again")
        self._driver.start()
        self._driver.cycle(None)
        self._setpoint = None
        self._ended.clear()
        self._thread = threading.Thread(target=self._run, name="dynamixel", daemon=True)
        self._thread.start()

    def write(self, position_rad: Array) -> None:
        """Hand over setpoints (J,); the newest wins. Raises ValueError if not finite or not J."""
        check_setpoint(position_rad, self._count)
        self._setpoint = position_rad.copy()

    def read(self) -> EncoderReading:
        """The reading of the newest cycle."""
        return self._driver.reading

    def faults(self) -> Mapping[str, str]:
        """The faults as text, by joint."""
        return self._driver.faults

    def quick_stop(self, stop: bool) -> None:
        """True: hold where the servos stand. False: take in again those that had a fault, and follow."""
        self._stop = stop
        self._recover = not stop

    def stop(self) -> None:
        """End the thread and close the port; the servos hold. Safe to call twice."""
        self._ended.set()
        if self._thread is not None:
            self._thread.join(_JOIN_S)
            self._thread = None
            self._driver.close()

    def metrics(self) -> ServoMetrics:
        """What went wrong on the bus."""
        driver = self._driver
        return ServoMetrics(
            counters={
                "missed": driver.missed,
                "broken": driver.broken,
                "lost": driver.lost,
                "late_cycles": self.late_cycles,
            },
            no_effort=driver.efforts.missing,
        )

    def _run(self) -> None:
        due_ns = self._clock()
        while not self._ended.is_set():
            if self._recover:
                self._recover = False
                self._driver.recover()
            self._driver.cycle(self._setpoint, self._stop)
            due_ns += self._period_ns
            late_ns = self._clock() - due_ns
            if late_ns > 0:
                skipped = -(-late_ns // self._period_ns)
                self.late_cycles += skipped
                due_ns += skipped * self._period_ns
            self._ended.wait(to_s(max(0, due_ns - self._clock())))
