"""The guard's states and the one table of how they follow each other; the docs' diagram is drawn from it."""

from __future__ import annotations

from enum import StrEnum


class State(StrEnum):
    """What the robot may do."""

    BOOT = "boot"
    """Waits until it knows where every joint stands."""
    HOLD = "hold"
    """Brakes to standstill and stays there."""
    ALIGN = "align"
    """Moves slowly to the operator's posture."""
    TRACK = "track"
    """Follows the operator within the joints' limits."""
    CLUTCH = "clutch"
    """Brakes to standstill and stays there until the operator, who never let go, presses the clutch again."""
    ESTOP = "estop"
    """Brakes to standstill and stays there until it is reset."""


class GuardEvent(StrEnum):
    """What makes a state change."""

    ENCODERS_VALID = "all encoders valid"
    ENGAGE = "engage"
    ALIGNED = "every joint within its window"
    DISENGAGE = "disengage"
    LOSS = "loss of lease, deadman, command or encoder"
    CLUTCH_OUT = "clutch released"
    CLUTCH_IN = "clutch pressed again"
    ESTOP = "e-stop"
    RESET = "reset"


TRANSITIONS: dict[tuple[State, GuardEvent], State] = {
    (State.BOOT, GuardEvent.ENCODERS_VALID): State.HOLD,
    (State.HOLD, GuardEvent.ENGAGE): State.ALIGN,
    (State.ALIGN, GuardEvent.ALIGNED): State.TRACK,
    (State.ALIGN, GuardEvent.DISENGAGE): State.HOLD,
    (State.ALIGN, GuardEvent.LOSS): State.HOLD,
    (State.TRACK, GuardEvent.DISENGAGE): State.HOLD,
    (State.TRACK, GuardEvent.LOSS): State.HOLD,
    (State.ALIGN, GuardEvent.CLUTCH_OUT): State.CLUTCH,
    (State.TRACK, GuardEvent.CLUTCH_OUT): State.CLUTCH,
    (State.CLUTCH, GuardEvent.CLUTCH_IN): State.ALIGN,
    (State.CLUTCH, GuardEvent.DISENGAGE): State.HOLD,
    (State.CLUTCH, GuardEvent.LOSS): State.HOLD,
    **{(state, GuardEvent.ESTOP): State.ESTOP for state in State},
    (State.ESTOP, GuardEvent.RESET): State.HOLD,
}
"""Every change there is. A pair that is not listed changes nothing."""

MOVING = frozenset({State.ALIGN, State.TRACK})
"""The only states in which the robot follows anybody."""
ENGAGED = MOVING | {State.CLUTCH}
"""The states that end with any loss: from there on somebody must engage again."""


def next_state(state: State, event: GuardEvent) -> State:
    """The state after an event."""
    return TRANSITIONS.get((state, event), state)


def mermaid() -> str:
    """The table as a Mermaid state diagram."""
    lines = ["stateDiagram-v2", f"    [*] --> {State.BOOT}"]
    lines += [f"    {before} --> {after}: {event}" for (before, event), after in TRANSITIONS.items()]
    return "\n".join(lines)
