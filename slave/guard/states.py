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
    ESTOP = "estop"
    """Brakes to standstill and stays there until it is reset."""


class Event(StrEnum):
    """What makes a state change."""

    ENCODERS_VALID = "all encoders valid"
    ENGAGE = "engage"
    ALIGNED = "every joint within its window"
    DISENGAGE = "disengage"
    LOSS = "loss of lease, deadman, command or encoder"
    ESTOP = "e-stop"
    RESET = "reset"


TRANSITIONS: dict[tuple[State, Event], State] = {
    (State.BOOT, Event.ENCODERS_VALID): State.HOLD,
    (State.HOLD, Event.ENGAGE): State.ALIGN,
    (State.ALIGN, Event.ALIGNED): State.TRACK,
    (State.ALIGN, Event.DISENGAGE): State.HOLD,
    (State.ALIGN, Event.LOSS): State.HOLD,
    (State.TRACK, Event.DISENGAGE): State.HOLD,
    (State.TRACK, Event.LOSS): State.HOLD,
    **{(state, Event.ESTOP): State.ESTOP for state in State},
    (State.ESTOP, Event.RESET): State.HOLD,
}
"""Every change there is. A pair that is not listed changes nothing."""

MOVING = frozenset({State.ALIGN, State.TRACK})
"""The only states in which the robot follows anybody."""


def next_state(state: State, event: Event) -> State:
    """The state after an event."""
    return TRANSITIONS.get((state, event), state)


def mermaid() -> str:
    """The table as a Mermaid state diagram."""
    lines = ["stateDiagram-v2", f"    [*] --> {State.BOOT}"]
    lines += [f"    {before} --> {after}: {event}" for (before, event), after in TRANSITIONS.items()]
    return "\n".join(lines)
