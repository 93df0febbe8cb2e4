"""The operators of a demo's robots: they engage every robot, keep it tracking, and let go at the end."""

from __future__ import annotations

from collections.abc import Callable

from common.clock import monotonic_ns
from deploy.harness.engage import (
    EngageDriver,
    GaveUpError,
    RigRobot,
    disengage,
    keep_engaged,
    until_all_track,
)
from deploy.harness.host import HostWatch
from deploy.harness.operator import HoldRecord, Operator, OperatorPatience
from deploy.harness.rig import Rig

PATIENCE = OperatorPatience(back_s=20.0, holds=3, holds_within_s=20.0)


class DemoOperators:
    """One operator a robot. `problem` says why one of them gave up; it is empty while none has."""

    def __init__(
        self,
        rig: Rig,
        host: HostWatch,
        check: Callable[[], None],
        write: Callable[[str], None],
        patience: OperatorPatience = PATIENCE,
    ) -> None:
        """`check` is called with every look and may raise TandemError; `write` prints a line for a person."""
        self._rig = rig
        self._check = check
        self._drivers = [self._driver(robot, host, write, patience) for robot in rig.observers]
        self.problem = ""

    def _driver(
        self, robot: str, host: HostWatch, write: Callable[[str], None], patience: OperatorPatience
    ) -> EngageDriver:
        operator = Operator(robot, patience, wanted_ns=monotonic_ns(), host_lost=host.lost_before)
        access = RigRobot(self._rig, robot)
        return EngageDriver(operator, access, on_hold=lambda hold: write(operator.words(hold)))

    async def follow(self, seconds: float, begin: Callable[[], None] = lambda: None) -> None:
        """Bring every robot into `track`, and keep it there for so long, until an operator gives up.

        `begin` is called when all track for the first time. Robots that hold at the end are waited for.
        """
        for observer in self._rig.observers.values():
            observer.recording = True
        try:
            await until_all_track(self._drivers, self._check)
            begin()
            await keep_engaged(self._drivers, seconds, self._check)
            await until_all_track(self._drivers, self._check)
        except GaveUpError as error:
            self.problem = str(error)

    async def let_go(self) -> None:
        """End the recording and disengage every robot. Raises TandemError where one does not hold then."""
        for observer in self._rig.observers.values():
            observer.recording = False
        for robot in self._rig.observers:
            await disengage(self._rig, robot, self._check)

    def holds(self) -> list[HoldRecord]:
        """A report's `holds`, in the order in which they happened."""
        operators = [driver.operator for driver in self._drivers]
        found = [operator.record(hold) for operator in operators for hold in operator.holds]
        return sorted(found, key=lambda hold: hold.at_s)
