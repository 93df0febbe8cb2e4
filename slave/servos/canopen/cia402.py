"""The power state machine of a CiA 402 drive, as its master sees it (CiA 402-2, device control). Pure."""

from __future__ import annotations

from enum import StrEnum

CYCLIC_SYNCHRONOUS_POSITION, INTERPOLATED_POSITION = 8, 7
"""Modes of operation (6060h)."""


class Power(StrEnum):
    """The states' names for people."""

    NOT_READY = "not ready to switch on"
    SWITCH_ON_DISABLED = "switch on disabled"
    READY = "ready to switch on"
    SWITCHED_ON = "switched on"
    ENABLED = "operation enabled"
    QUICK_STOP = "quick stop active"
    FAULT_REACTION = "fault reaction active"
    FAULT = "fault"


DISABLE_VOLTAGE = 0x00
SHUTDOWN, SWITCH_ON, ENABLE, QUICK_STOP, FAULT_RESET = 0x06, 0x07, 0x0F, 0x02, 0x80
"""Controlwords (6040h). A drive takes FAULT_RESET at the rising edge of its bit only."""
ENABLE_WORDS = {CYCLIC_SYNCHRONOUS_POSITION: ENABLE, INTERPOLATED_POSITION: ENABLE | 1 << 4}
"""What keeps an enabled drive going, by mode. In interpolated position mode bit 4 lets it follow."""

_PATTERNS = (
    # mask and value of the statusword (6041h), CiA 402-2
    (0x4F, 0x00, Power.NOT_READY),
    (0x4F, 0x40, Power.SWITCH_ON_DISABLED),
    (0x6F, 0x21, Power.READY),
    (0x6F, 0x23, Power.SWITCHED_ON),
    (0x6F, 0x27, Power.ENABLED),
    (0x6F, 0x07, Power.QUICK_STOP),
    (0x4F, 0x0F, Power.FAULT_REACTION),
    (0x4F, 0x08, Power.FAULT),
)
STATE_BITS = 0x6F
"""The bits of a statusword that tell the state."""
ENABLED_BITS = 0x27


def power(statusword: int) -> Power | None:
    """The state in a statusword, or None for a pattern that is not in the standard."""
    for mask, value, state in _PATTERNS:
        if statusword & mask == value:
            return state
    return None


def towards_enabled(
    state: Power | None,
    last_controlword: int,
    reset_fault: bool,
    *,
    knows_16: bool = True,
    mode: int = CYCLIC_SYNCHRONOUS_POSITION,
) -> int:
    """The controlword that leads one step nearer to ENABLED.

    From QUICK_STOP straight back, without ever letting the joint go: transition 16, which CiA 402 leaves to
    the maker. A drive that does not know it (`knows_16` false) can only be led round by "disable voltage"
    (transition 12). A fault is reset only where allowed, with the bit lowered in between.
    """
    match state:
        case Power.SWITCH_ON_DISABLED:
            return SHUTDOWN
        case Power.READY:
            return SWITCH_ON
        case Power.QUICK_STOP if not knows_16:
            return DISABLE_VOLTAGE
        case Power.ENABLED:
            return ENABLE_WORDS[mode]
        case Power.SWITCHED_ON | Power.QUICK_STOP:
            return ENABLE
        case Power.FAULT if reset_fault and last_controlword != FAULT_RESET:
            return FAULT_RESET
    return SHUTDOWN
