"""Brings the drives of one robot from unknown to operational: configure (SDO) ▸ start (NMT). Pure."""

from __future__ import annotations

from collections.abc import Sequence

from slave.servos.canopen.drive import DriveState, Phase
from slave.servos.canopen.readings import DriveReadings
from slave.servos.canopen.second_master import SecondMaster
from slave.servos.canopen.silence import DriveSilence
from slave.servos.canopen.supervision import LISTENED, Supervision
from slave.servos.canopen.torque_limits import DriveTorqueLimits
from slave.servos.canopen.watch import DriveWatch
from slave.servos.canopen.wiring import (
    BOOTED,
    OPERATIONAL,
    PRE_OPERATIONAL,
    START,
    STOP,
    DriveWiring,
    Outgoing,
)


class DriveStarts:
    """The starts of all J drives."""

    def __init__(
        self,
        drives: Sequence[DriveState],
        wiring: DriveWiring,
        supervision: Supervision,
        *,
        silence: DriveSilence,
        watch: DriveWatch,
        readings: DriveReadings,
        limits: DriveTorqueLimits,
        second_master: SecondMaster,
        may_reset: bool,
    ) -> None:
        """`may_reset`: whether a start may reset a drive's fault."""
        self._drives, self._wiring, self._supervision = drives, wiring, supervision
        self._silence, self._watch, self._readings, self._limits = silence, watch, readings, limits
        self._second_master, self._may_reset = second_master, may_reset
        self._commands = False
        """Whether it has ever sent a drive anything: before, another master may be the rightful one."""
        self.outbox: list[Outgoing] = []
        """What must be sent at once."""

    def begin(self, now_ns: int, configure: bool) -> bool:
        """Start every drive; not while a second master speaks."""
        if self._second_master.speaks(now_ns):
            return False
        self._second_master.forget()
        self._supervision.stopping = False
        self._commands = self._commands or configure
        for i in range(len(self._drives)):
            self._start(i, now_ns, configure)
        return True

    def on_sdo(self, i: int, data: bytes, now_ns: int) -> bool:
        """A drive's SDO answer. Returns whether no further request follows."""
        was = self._drives[i].phase
        request = self._drives[i].on_sdo(data, now_ns)
        self._sent(i, request, was, now_ns)
        return request is None

    def pending(self, now_ns: int) -> None:
        """Repeat SDO requests whose answers are overdue."""
        for i, drive in enumerate(self._drives):
            was = drive.phase
            self._sent(i, drive.overdue(now_ns), was, now_ns)

    def on_state(self, i: int, state: int, now_ns: int) -> bool:
        """A drive's NMT state: by its heartbeat, its start, or its answer to node guarding.

        Returns whether that changes what is known of the drive.
        """
        drive = self._drives[i]
        if self._commands and self._second_master.buses and state == OPERATIONAL:
            self.outbox.append(self._wiring.nmt(i, STOP))  # the other has started it again
            return False
        second = drive.boots_twice and drive.booted_just_now(now_ns) and drive.phase is not Phase.RUNNING
        if state == BOOTED and (drive.phase is Phase.CONFIGURING or (second and drive.phase in LISTENED)):
            # what it was told before is forgotten, the slave's heartbeat that it shall watch for among it
            if drive.on_boot(now_ns):
                self._start(i, now_ns, configure=True)
            return True
        # while it is enabled, a heartbeat from before NMT's start may still be on its way
        left = drive.phase is Phase.RUNNING and state != OPERATIONAL
        changed = left or (drive.phase in (Phase.CHECKING, Phase.ENABLING) and state == BOOTED)
        if changed and state == BOOTED:
            drive.restart(now_ns)
        elif changed:
            drive.fail("is not operational", reconfigure=True)
        return changed

    def stop_by_nmt(self) -> None:
        """Stop all drives by what two masters' controlwords cannot take turns at."""
        if any(drive.phase is not Phase.FAILED for drive in self._drives):
            for i, drive in enumerate(self._drives):
                drive.fail("stopped", reconfigure=True)
                self.outbox.append(self._wiring.nmt(i, STOP))

    def _start(self, i: int, now_ns: int, configure: bool) -> None:
        drive = self._drives[i]
        self._supervision.restart(i)
        first = drive.start(now_ns, self._may_reset, configure)
        if first is not None:
            self.outbox.append(self._wiring.nmt(i, PRE_OPERATIONAL))
            self.outbox.append(self._wiring.sdo(i, first))
        else:
            self._silence.begin(i, now_ns)

    def _sent(self, i: int, request: bytes | None, was: Phase, now_ns: int) -> None:
        if request is not None:
            self.outbox.append(self._wiring.sdo(i, request))
        elif was is Phase.CONFIGURING and self._drives[i].phase is Phase.CHECKING:
            self._operate(i, now_ns)

    def _operate(self, i: int, now_ns: int) -> None:
        setup = self._drives[i].setup
        self._silence.begin(i, now_ns)
        self._wiring.connect(i, setup.plan.pdos, setup.plan.guarded)
        self._readings.efforts.configured(i, setup.held, setup.plan.no_effort(setup.lacks))
        self._limits.configured(i, setup.held, setup.plan.no_limit(setup.lacks))
        self._watch.connect(i)
        self.outbox.append(self._wiring.nmt(i, START))
