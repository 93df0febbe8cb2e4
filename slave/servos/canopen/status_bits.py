"""What an enabled drive's statusword must say besides its state (CiA 402-2, object 6041h). Pure.

"Operation enabled" alone does not mean that the drive does what it is told. In cyclic synchronous position
mode bit 12 says that it follows the target, bit 11 that a limit of its own stands in the way, bit 9 that it
takes controlwords from the bus, bit 4 that its motor stage has voltage, bit 7 that a failure is near.
"""

from __future__ import annotations

VOLTAGE, WARNING, REMOTE, LIMITED, FOLLOWS = 1 << 4, 1 << 7, 1 << 9, 1 << 11, 1 << 12

WATCHED = VOLTAGE | REMOTE | LIMITED | FOLLOWS
GOOD = VOLTAGE | REMOTE | FOLLOWS
"""What WATCHED must be while enabled."""
BAD_SYNCS = 2
"""An enabled drive whose bits are wrong in so many answers in a row is stopped: 40 ms at 50 Hz."""

_WORDS = (
    (VOLTAGE, False, "its motor stage has no voltage (statusword bit 4)"),
    (REMOTE, False, "it is under local control and takes no commands from the bus (bit 9)"),
    (LIMITED, True, "a limit of its own is active: position, speed or current (bit 11)"),
    (FOLLOWS, False, "it does not follow its target (bit 12)"),
)


def wrong_bits(statusword: int, enabled: bool = True) -> str:
    """The fault as text; empty if there is none. Bits 4 and 12 count only while `enabled`."""
    asked = WATCHED if enabled else REMOTE | LIMITED
    wrong = [words for bit, bad, words in _WORDS if bit & asked and bool(statusword & bit) is bad]
    return "; ".join(wrong)
