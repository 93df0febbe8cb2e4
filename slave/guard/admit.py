"""The gates that every command must pass, in order, and what the newest accepted command contained.

Each gate is a small pure function that refuses with its reason.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from common.clock import to_ms, to_ns
from common.clock_sync import Offset
from common.wire.messages import Command, Mask
from slave.guard.config import GuardConfig
from slave.guard.events import GuardCounters
from slave.guard.lease import DrawToken, Lease, random_token
from slave.guard.times import LinkTimes


@dataclass(frozen=True, slots=True)
class Situation:
    """What the slave knows at the moment it judges a command."""

    robot: str
    joints: int
    live_token: int
    """Token of the current lease, 0 where there is none."""
    holder: str
    """The operator to whom that lease was granted."""
    revoked: frozenset[str]
    """Operators whose certificates are revoked."""
    newest_sequence: int
    """The number of the last command accepted within this lease, -1 before the first."""
    now_ns: int
    offset: Offset
    """The master's clock against the slave's."""
    max_age_ns: int
    """In force now."""
    age_ceiling_ns: int
    """The most that the site allows it to become."""
    future_tolerance_ns: int

    def sampled_ns(self, command: Command) -> int:
        """When the operator stood so, on the slave's clock."""
        return self.offset.local_ns(command.stamps.sampled_ns)

    def age_ns(self, command: Command) -> int:
        """How long ago that was. Counted to now, not to arrival: waiting in a mailbox ages it too."""
        return self.now_ns - self.sampled_ns(command)


@dataclass(frozen=True, slots=True)
class Gate:
    """One condition. `refusal` says why a command does not meet it, or None where it does."""

    name: str
    asks: str
    """The rule as a sentence; the docs' table is made of these."""
    refusal: Callable[[Command, Situation], str | None]


@dataclass(frozen=True, slots=True)
class Admission:
    """What became of a command: accepted, or the gate that refused it and why."""

    accepted: bool
    gate: str = ""
    reason: str = ""


def _robot(command: Command, at: Situation) -> str | None:
    return None if command.robot == at.robot else f"is for {command.robot!r}, this is {at.robot!r}"


def _revoked(command: Command, at: Situation) -> str | None:
    return revocation(command.operator, at.revoked)


def revocation(operator: str, revoked: frozenset[str]) -> str | None:
    """Why an operator may not command any more, or None."""
    return f"the certificate of {operator} is revoked" if operator in revoked else None


def _lease(command: Command, at: Situation) -> str | None:
    if at.live_token == 0:
        return "nobody holds the lease"
    return None if command.lease == at.live_token else "not from the holder of the lease"


def _operator(command: Command, at: Situation) -> str | None:
    if command.operator == at.holder:
        return None
    return f"bears the lease of {at.holder}, but came from {command.operator or 'nobody'}"


def _valid(command: Command, at: Situation) -> str | None:
    shape = (at.joints,)
    if command.valid.shape != shape or command.valid.dtype != np.bool_:
        return f"mask is not of {at.joints} joints"
    for values in (command.position_rad, command.velocity_rad_s):
        if values.shape != shape:
            return f"not {at.joints} joints"
        if not np.isfinite(values).all():
            return "a value is not finite"
    return None


def _sequence(command: Command, at: Situation) -> str | None:
    if command.sequence > at.newest_sequence:
        return None
    return f"number {command.sequence} is not newer than {at.newest_sequence}"


def _clock(_: Command, at: Situation) -> str | None:
    return None if at.offset.trusted else "the offset between the clocks is not trusted"


def _age(command: Command, at: Situation) -> str | None:
    oldest_ns = at.age_ns(command) + at.offset.bound_ns
    if oldest_ns <= at.max_age_ns:
        return None
    words = f"may be {to_ms(oldest_ns):.0f} ms old, limit {to_ms(at.max_age_ns):.0f} ms"
    if oldest_ns <= at.age_ceiling_ns:
        return words
    return f"{words}, the site's ceiling (max_age_ceiling_s) {to_ms(at.age_ceiling_ns):.0f} ms"


def _future(command: Command, at: Situation) -> str | None:
    # the offset is known to ± its bound, so a fresh command can seem to come from a little ahead
    ahead_ns = -at.age_ns(command)
    if ahead_ns <= at.offset.bound_ns + at.future_tolerance_ns:
        return None
    return f"is from {to_ms(ahead_ns):.0f} ms in the future"


def _deadman(command: Command, _: Situation) -> str | None:
    return None if command.deadman_held else "the deadman is released"


AGE, DEADMAN = "age", "deadman"
_GENUINE = (AGE, DEADMAN)
"""What these refuse has passed the gates that tell whose it is, whether it is new, and by which clock."""
GATES: tuple[Gate, ...] = (
    Gate("robot", "it is for this robot", _robot),
    Gate("revoked", "the certificate of its operator is not revoked", _revoked),
    Gate("lease", "it carries the token of the current lease", _lease),
    Gate("operator", "it came on the key of the operator that holds the lease", _operator),
    Gate("valid", "one finite position and velocity a joint", _valid),
    Gate("sequence", "its number is above that of the last accepted one", _sequence),
    Gate("clock", "the offset between the two clocks is trusted", _clock),
    Gate(AGE, "its age plus the offset's bound is at most `max_age_s`", _age),
    Gate("future", "it is ahead by at most the offset's bound plus `future_tolerance_s`", _future),
    Gate(DEADMAN, "the operator holds the deadman; if not, the robot holds at once", _deadman),
)
"""In this order, so that the deadman of a foreign, stale or replayed command does not stop the robot."""


def admit(command: Command, at: Situation, gates: Sequence[Gate] = GATES) -> Admission:
    """Judge a command: the first gate that refuses it is the one that the answer names."""
    for gate in gates:
        reason = gate.refusal(command, at)
        if reason is not None:
            return Admission(False, gate.name, reason)
    return Admission(True)


class CommandGate:
    """Judges one command after the other, and keeps the newest accepted one's validity and doubt."""

    def __init__(
        self,
        robot: str,
        joints: int,
        config: GuardConfig,
        counters: GuardCounters,
        draw_token: DrawToken = random_token,
        gates: Sequence[Gate] = GATES,
    ) -> None:
        self.times = LinkTimes(config)
        self._measured = ""
        """The operator whose line that is."""
        self.lease = Lease(to_ns(config.lease_timeout_s), draw_token, to_ns(config.offer_timeout_s))
        self.revoked: frozenset[str] = frozenset()
        """Operators whose certificates are revoked."""
        self.valid: Mask = np.zeros(joints, np.bool_)
        """(J,) joints that the newest accepted command gives a valid angle of."""
        self.operator_doubt = ""
        """Why the master advises against an engage, by that command; empty where it does not."""
        self.clutch_out = False
        """Whether the operator has released the clutch, by that command."""
        self.arrived_ns: int | None = None
        """Arrival of the last accepted command, None where there was none since the last loss."""
        self.refusal = ""
        """Why the last command since then was refused, empty where none was."""
        self._robot = robot
        self._counters = counters
        self._gates = tuple(gates)
        self._future_tolerance_ns = to_ns(config.future_tolerance_s)
        self._newest_sequence = -1
        self._somebody_ns: int | None = None

    def judge(
        self, command: Command, received_ns: int, now_ns: int, offset: Offset, *, moving: bool = False
    ) -> Admission:
        """Accept or refuse a command that arrived at `received_ns`; `moving`: whether the robot follows.

        A refused one changes counters only, and what is known of the link. But where the deadman is
        released, nothing that came before this command may engage any more.
        """
        self.lease.lapse(now_ns)
        situation = Situation(
            self._robot, len(self.valid), self.lease.token, self.lease.operator, self.revoked,
            self._newest_sequence, now_ns, offset, self.times.max_age_ns, self.times.ceilings_ns[0],
            self._future_tolerance_ns,
        )  # fmt: skip
        admission = admit(command, situation, self._gates)
        if admission.accepted or admission.gate in _GENUINE:
            self.times.note(command, received_ns, offset, moving=moving)
        if not admission.accepted:
            self._counters.dropped[admission.gate] += 1
            self.refusal = admission.reason
            if admission.gate == DEADMAN:
                self._newest_sequence, self.arrived_ns = command.sequence, None
            return admission
        self._counters.accepted += 1
        self.lease.renew(received_ns)
        self._newest_sequence, self.arrived_ns, self.refusal = command.sequence, received_ns, ""
        self.valid, self.operator_doubt = command.valid.copy(), command.doubt
        self.clutch_out = command.clutch_out
        if command.valid.any():
            self._somebody_ns = received_ns
        return admission

    def somebody_ns(self, now_ns: int) -> int | None:
        """Now where the newest command has a valid joint, else arrival of the last that had one."""
        return now_ns if self.valid.any() else self._somebody_ns

    def claim(self, operator: str, now_ns: int) -> int:
        """The token of a new lease, or 0 if an operator holds one. Its commands are counted from 0."""
        token = self.lease.claim(operator, now_ns)
        if token:
            self.times.begin()
            if operator != self._measured:
                self.times.forget()
                self._measured = operator
            self._newest_sequence, self.arrived_ns, self.refusal = -1, None, ""
        return token
