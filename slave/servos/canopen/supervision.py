"""Leads every drive to running, SYNC by SYNC, and stops one that does what was not asked for. Pure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from common.wire.messages import Mask
from slave.servos.canopen.answers import DriveAnswers
from slave.servos.canopen.cia402 import ENABLED_BITS, SHUTDOWN, STATE_BITS
from slave.servos.canopen.drive import DriveState, Phase
from slave.servos.canopen.silence import DriveSilence
from slave.servos.canopen.watch import DriveWatch

LISTENED = (Phase.CHECKING, Phase.ENABLING, Phase.RUNNING)
"""Phases in which a drive must be heard."""


class Supervision:
    """The phases of all J drives."""

    def __init__(self, drives: Sequence[DriveState], watch: DriveWatch, silence: DriveSilence) -> None:
        self._drives = drives
        self._watch = watch
        self._silence = silence
        self._controlwords = np.full(len(drives), SHUTDOWN, np.uint16)
        self.running: Mask = np.zeros(len(drives), np.bool_)
        """(J,) drives that are enabled and follow."""
        self.settled = False
        """Whether all drives run without a fault, so that none needs to be looked at by itself."""
        self.stopping = False
        """Whether every drive is commanded to brake and stay."""
        self.warnings: Mapping[str, str] = MappingProxyType({})
        """What drives warn of, by joint: no reason to stop yet."""

    def restart(self, drive: int) -> None:
        """Lead a drive to running from the beginning."""
        self.running[drive] = self.settled = False
        self._watch.restart(drive)

    def fail(self, drive: int, why: str) -> None:
        """Command a drive to stop; it stays stopped until a request enables it."""
        self._drives[drive].fail(why)
        self.settled = False

    def look(self, now_ns: int, seen: DriveAnswers) -> None:
        """Enable the drives that may be enabled, and stop those that do something else than commanded."""
        self._watch.take(seen)
        if not self.settled:
            self._check(now_ns, seen)
        on = self.running.copy() if self.settled else self._switched_on()
        for i, why in self._watch.judge(seen, on, self.running).items():
            self.fail(i, why)
        warnings = self._watch.warnings(seen)
        if warnings != self.warnings:
            self.warnings = MappingProxyType(warnings)

    def _check(self, now_ns: int, seen: DriveAnswers) -> None:
        for i, drive in enumerate(self._drives):
            waits = drive.boots_twice and drive.booted_just_now(now_ns)  # for the second report of its start
            if drive.phase is Phase.CHECKING and seen.fresh[i] and not self.stopping and not waits:
                passed, why = self._watch.check(i, seen)
                if why:
                    self.fail(i, why)
                elif passed:
                    drive.admit(now_ns)

    def _switched_on(self) -> Mask:
        on = (Phase.ENABLING, Phase.RUNNING)
        phases = [drive.phase in on and not self.stopping for drive in self._drives]
        out: Mask = np.array(phases, np.bool_)
        return out

    def controlwords(self, now_ns: int, seen: DriveAnswers) -> NDArray[np.uint16]:
        """(J,) what to tell the drives with the next SYNC."""
        silent = self._silence.silent(now_ns)
        enabled = seen.statusword & STATE_BITS == ENABLED_BITS
        if self.settled and not silent.any() and enabled[seen.fresh].all():
            return self._controlwords
        self.settled = False
        words = np.empty_like(self._controlwords)
        for i, drive in enumerate(self._drives):
            if silent[i] and drive.phase in LISTENED:
                drive.fail("silent: neither heartbeat nor position", reconfigure=True)
            words[i] = drive.controlword(int(seen.statusword[i]), bool(seen.fresh[i]), self.stopping, now_ns)
            self.running[i] = drive.phase is Phase.RUNNING and not self.stopping
        self._controlwords = words
        return words
