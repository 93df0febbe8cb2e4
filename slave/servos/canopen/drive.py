"""Where one drive stands on its way from unknown to running, and what is wrong with it. Pure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum, auto

from common.clock import NS_PER_MS
from slave.servos.canopen.cia402 import (
    ENABLE_WORDS,
    FAULT_RESET,
    QUICK_STOP,
    SHUTDOWN,
    Power,
    power,
    towards_enabled,
)
from slave.servos.canopen.emergency import HEARTBEAT_MISSED, PDO_MISSED, SAFE_TORQUE_OFF, Emergency
from slave.servos.canopen.setup_run import SetupRun
from slave.servos.canopen.status_bits import wrong_bits

ENABLE_TIMEOUT_NS = 2000 * NS_PER_MS
TRANSITION_16_NS = 500 * NS_PER_MS
"""A drive that stays in quick stop active for this long after "enable" does not know transition 16.
Until then it has also braked: "disable voltage" lets the joint go for some SYNCs."""
_WITHOUT_FAULT = (Power.SWITCH_ON_DISABLED, Power.READY, Power.SWITCHED_ON)
_BOOTS_APART_NS = 1000 * NS_PER_MS
"""Two boot-ups of one id closer together are of two drives."""
_BY_ITS_MANUAL = ", or it reports each start twice by its manual: then set boots_twice = true"


class Phase(Enum):
    """What is being done with a drive."""

    CONFIGURING = auto()
    CHECKING = auto()
    """Configured, and listened to; not enabled before `StartGate` lets it."""
    ENABLING = auto()
    RUNNING = auto()
    FAILED = auto()
    """Latched: the drive is commanded to stop and stay; only a request enables it again."""


@dataclass(slots=True)
class DriveState:
    """One drive. Its frames come in by `on_sdo`, what it shall do goes out by `controlword`."""

    setup: SetupRun
    phase: Phase = Phase.FAILED
    failure: str = "not started"
    emergency: Emergency | None = None
    configured: bool = False
    encoder: str = ""
    """The fault of its encoder as text."""
    since_ns: int = 0
    """When the phase began."""
    sto_codes: Sequence[int] = (SAFE_TORQUE_OFF,)
    """Emergency codes that say that safe torque off is active."""
    torque_off_ns: int = 0
    """When it said last that safe torque off is active, or behaved as if it were; 0: never."""
    torque_off: str = ""
    """What it said."""
    boots_twice: bool = False
    """Whether it reports its start twice, as the robot's file says."""
    torqueless: bool = False
    """It is well, but cannot be enabled: as if its safe torque off input were open."""
    _controlword: int = SHUTDOWN
    _may_reset: bool = False
    _told_sto: bool = False
    _booted_ns: int | None = None
    _was_running: bool = False

    def start(self, now_ns: int, may_reset: bool, configure: bool) -> bytes | None:
        """On the way to RUNNING, whatever was before; the SDO request that comes first, if any.

        With `configure` everything is sent anew, and an answer is waited for without end: the caller sets it.
        """
        self.failure, self.emergency, self._may_reset = "", None, may_reset
        self.torqueless = False
        self.since_ns = now_ns
        self._was_running = self.phase is Phase.RUNNING and not configure
        if not configure and self.configured:
            self.phase = Phase.CHECKING
            return None
        self.phase, self.configured = Phase.CONFIGURING, False
        return self._go_on(self.setup.begin(now_ns, patient=configure), now_ns)

    def fail(self, why: str, reconfigure: bool = False) -> None:
        """Latch a failure; the first one stays."""
        if self.phase is not Phase.FAILED:
            self.phase, self.failure = Phase.FAILED, why
        if reconfigure:
            self.configured = False

    def on_sdo(self, data: bytes, now_ns: int) -> bytes | None:
        """The next request, or None: nothing was waited for, it failed, or all is done (`configured`)."""
        if self.setup.answers_twice(data):
            self.fail("answers one request twice: two drives have its id", reconfigure=True)
        if self.phase is not Phase.CONFIGURING or self.configured:
            return None
        return self._go_on(self.setup.on_answer(data, now_ns), now_ns)

    def _go_on(self, request: bytes | None, now_ns: int) -> bytes | None:
        """Take over what the set-up has come to, if it has ended."""
        if self.setup.failure:
            self.fail(self.setup.failure)
        elif self.setup.done:
            self.configured = True
            self.phase, self.since_ns = Phase.CHECKING, now_ns
        return request

    def on_boot(self, now_ns: int) -> bool:
        """It reports its start. False: two did so at once, so two drives have its id, and it has failed."""
        again = self.booted_just_now(now_ns)
        self._booted_ns = now_ns
        if again and not self.boots_twice:
            self.fail(
                f"has reported two starts within one second: two drives have its id{_BY_ITS_MANUAL}", True
            )
            return False
        return True

    def booted_just_now(self, now_ns: int) -> bool:
        """Whether it reported a start within the last second."""
        return self._booted_ns is not None and now_ns - self._booted_ns < _BOOTS_APART_NS

    def restart(self, now_ns: int) -> None:
        """It reports a start although it is configured."""
        self.fail(
            "has restarted" + (_BY_ITS_MANUAL if self.booted_just_now(now_ns) else ""), reconfigure=True
        )

    def on_emergency(self, message: Emergency, now_ns: int) -> None:
        """An emergency message: an error, or that all errors are gone."""
        self.emergency = None if message.over else message
        self._told_sto = message.code in self.sto_codes
        if self._told_sto:
            self.torque_off_ns, self.torque_off = now_ns, f"says: {message.words}"
        if message.code in (HEARTBEAT_MISSED, PDO_MISSED) and self.phase is Phase.RUNNING:
            # told "enable" right after, it would go on as if nothing had been
            self.fail("has stopped by itself")

    def admit(self, now_ns: int) -> None:
        """Checked: from now on it is led to RUNNING."""
        if self.phase is Phase.CHECKING:
            self.phase, self.since_ns = Phase.ENABLING, now_ns

    def overdue(self, now_ns: int) -> bytes | None:
        """The request once more, where its answer is overdue; after the last try it has failed."""
        if self.phase is not Phase.CONFIGURING:
            return None
        return self._go_on(self.setup.overdue(now_ns), now_ns)

    def controlword(self, statusword: int, answered: bool, stopping: bool, now_ns: int) -> int:
        """What to send it, by the statusword it last sent (`answered`: since the last SYNC)."""
        state = power(statusword)
        if self.phase is Phase.FAILED or stopping:
            if stopping and answered and state in (Power.FAULT, Power.FAULT_REACTION):
                self.fail("drive fault")
            self._controlword = QUICK_STOP
        elif self.phase is Phase.CHECKING:
            # one that goes on holding is not made to brake and start anew
            goes_on = self._was_running and state is Power.ENABLED
            self._controlword = ENABLE_WORDS[self.setup.plan.mode] if goes_on else QUICK_STOP
        elif self.phase is Phase.ENABLING and answered:
            self._enable(state, statusword, now_ns)
        elif self.phase is Phase.RUNNING and answered and state is not Power.ENABLED:
            self._drop(state, now_ns)
            self.fail(_why_not(state, statusword))
            self._controlword = QUICK_STOP
        return self._controlword

    def _enable(self, state: Power | None, statusword: int, now_ns: int) -> None:
        wrong = wrong_bits(statusword) if state is Power.ENABLED else ""
        if state is Power.ENABLED and not wrong:
            self.phase = Phase.RUNNING
        elif wrong and now_ns - self.since_ns > ENABLE_TIMEOUT_NS:
            self.fail(f"is enabled, but {wrong}")
            self._controlword = QUICK_STOP
            return
        elif now_ns - self.since_ns > ENABLE_TIMEOUT_NS or (state is Power.FAULT and not self._may_reset):
            self._drop(state, now_ns)
            self.fail(f"cannot be enabled: it is in {state or 'no state'}")
            self._controlword = QUICK_STOP
            return
        knows_16 = now_ns - self.since_ns < TRANSITION_16_NS
        self._controlword = towards_enabled(
            state, self._controlword, self._may_reset, knows_16=knows_16, mode=self.setup.plan.mode
        )
        if self._controlword == FAULT_RESET:
            self.emergency = None

    def _drop(self, state: Power | None, now_ns: int) -> None:
        """It has no torque, or loses it, in this state: a fault, or what safe torque off looks like."""
        self.torqueless = self._told_sto or state in _WITHOUT_FAULT
        if self.torqueless:
            self.torque_off_ns = now_ns
            if not self._told_sto:
                self.torque_off = f"has no torque: {state}"

    @property
    def words(self) -> str:
        """What is wrong with it; empty where all is well."""
        problems = [self.failure] if self.failure else []
        if self.phase in (Phase.CONFIGURING, Phase.CHECKING, Phase.ENABLING):
            problems.append(self.setup.silence if self.setup.asked_again else "is being enabled")
        if self.emergency is not None:
            problems.append(self.emergency.words)
        if self.encoder:
            problems.append(self.encoder)
        return "; ".join(problems)


def _why_not(state: Power | None, statusword: int) -> str:
    if state in (Power.FAULT, Power.FAULT_REACTION):
        return "drive fault"
    if state is None:
        return f"has left operation: statusword {statusword:04X}"
    return f"has left operation by itself: {state}"
