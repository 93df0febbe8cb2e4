"""The conditions of an engage. Each returns a text for what is missing."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from common.wire.together import only_beside
from slave.guard.admit import CommandGate
from slave.guard.joints import JointReadings
from slave.guard.states import MOVING, State


@dataclass(frozen=True, slots=True)
class Readiness:
    """What the guard knows when an operator asks to engage."""

    state: State
    reason: str
    operator: str
    """The operator that asks."""
    holder: str
    """The operator that holds the lease; empty: none."""
    command_loss: str | None
    """What is wrong with the commands."""
    encoder_loss: str | None
    """What is wrong with the encoders."""
    body_fault: str | None
    """What is wrong with the drives or the base."""
    commands: CommandGate
    """The last accepted command."""
    joints: JointReadings
    """Where the joints are, and are held."""
    together: bool = False
    """Whether the operator means to move this robot beside others."""


Condition = Callable[[Readiness], str | None]


def _state(at: Readiness) -> str | None:
    if at.state is State.BOOT:
        return at.reason
    if at.state is State.ESTOP:
        return "the e-stop is latched: reset it first"
    if at.state is State.CLUTCH:
        return "already engaged: the robot follows again once the clutch is pressed"
    return f"already in {at.state}" if at.state in MOVING else None


def holder_only(operator: str, holder: str) -> str | None:
    """Why an operator may not make a request that only the lease holder may make, or None."""
    if not holder:
        return "no operator holds the lease: claim it first"
    return None if operator == holder else f"{holder} holds the lease"


def _holder(at: Readiness) -> str | None:
    return holder_only(at.operator, at.holder)


def _command(at: Readiness) -> str | None:
    return at.command_loss


def _operator_side(at: Readiness) -> str | None:
    doubt = at.commands.operator_doubt
    return None if at.together and only_beside(doubt) else doubt or None


def _clutch(at: Readiness) -> str | None:
    return "the clutch is released: press it, and hold it" if at.commands.clutch_out else None


def _valid(at: Readiness) -> str | None:
    return None if at.commands.valid.any() else "no joint of the last command is valid"


def _encoder(at: Readiness) -> str | None:
    return at.encoder_loss


def _body(at: Readiness) -> str | None:
    return at.body_fault


def _unsettled(at: Readiness) -> str | None:
    return at.joints.plausible.unsettled()


def _rest(at: Readiness) -> str | None:
    return None if at.joints.at_rest else "still braking"


def _strayed(at: Readiness) -> str | None:
    return at.joints.strayed()


CONDITIONS: tuple[Condition, ...] = (
    _state, _holder, _command, _operator_side, _clutch, _valid, _encoder, _body, _unsettled, _rest, _strayed,
)  # fmt: skip


def refusal(at: Readiness) -> str | None:
    """Why the robot does not engage, or None where it may."""
    for condition in CONDITIONS:
        reason = condition(at)
        if reason is not None:
            return reason
    return None
