"""The gates every command must pass, in order, as small pure functions; each refuses with its reason."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from common.clock import to_ms
from common.clock_sync import Offset
from common.wire.messages import Command


@dataclass(frozen=True, slots=True)
class Situation:
    """What the slave knows at the moment it judges a command."""

    robot: str
    joints: int
    live_token: int
    """Token of the live lease, 0 where there is none."""
    newest_sequence: int
    """Of the last command accepted within this lease, -1 before the first."""
    now_ns: int
    offset: Offset
    """The master's clock against the slave's."""
    max_age_ns: int
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
    """What it asks for, in words; the docs' table is made of these."""
    refusal: Callable[[Command, Situation], str | None]


@dataclass(frozen=True, slots=True)
class Admission:
    """What became of a command: accepted, or the gate that refused it and why."""

    accepted: bool
    gate: str = ""
    reason: str = ""


def _robot(command: Command, at: Situation) -> str | None:
    return None if command.robot == at.robot else f"is for {command.robot!r}, this is {at.robot!r}"


def _lease(command: Command, at: Situation) -> str | None:
    if at.live_token == 0:
        return "nobody holds the lease"
    return None if command.lease == at.live_token else "not from the holder of the lease"


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
    return f"may be {to_ms(oldest_ns):.0f} ms old, limit {to_ms(at.max_age_ns):.0f} ms"


def _future(command: Command, at: Situation) -> str | None:
    # the offset is known to ± its bound, so a fresh command can seem to come from a little ahead
    ahead_ns = -at.age_ns(command)
    if ahead_ns <= at.offset.bound_ns + at.future_tolerance_ns:
        return None
    return f"is from {to_ms(ahead_ns):.0f} ms in the future"


def _deadman(command: Command, _: Situation) -> str | None:
    return None if command.deadman_held else "the deadman is released"


DEADMAN = "deadman"
GATES: tuple[Gate, ...] = (
    Gate("robot", "it is for this robot", _robot),
    Gate("lease", "it carries the token of the live lease", _lease),
    Gate("valid", "one finite position and velocity a joint", _valid),
    Gate("sequence", "its number is above that of the last accepted one", _sequence),
    Gate("clock", "the offset between the two clocks is trusted", _clock),
    Gate("age", "its age plus the offset's bound is at most `max_age_s`", _age),
    Gate("future", "it is ahead by at most the offset's bound plus `future_tolerance_s`", _future),
    Gate(DEADMAN, "the operator holds the deadman; if not, the robot holds at once", _deadman),
)
"""In this order, so that the deadman of a stranger's, stale or replayed command stops nobody."""


def admit(command: Command, at: Situation, gates: Sequence[Gate] = GATES) -> Admission:
    """Judge a command: the first gate that refuses it is the one that the answer names."""
    for gate in gates:
        reason = gate.refusal(command, at)
        if reason is not None:
            return Admission(False, gate.name, reason)
    return Admission(True)
