"""The description of a fault: what is done, what the robot must do and how soon, what a person does then."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

NOTICED_S = 0.21
"""`command_timeout_s` of 0.2 s, and the step in which the guard sees it."""
BRAKED_S = 0.3
"""From the order to brake to standstill, the servos' settling included."""
AT_ONCE_S = 0.01
"""The next step but one."""
ENGAGE = "Remove the cause, then engage; the robot goes slowly to the operator's posture."
NOTHING = "Nothing."


class Reaction(StrEnum):
    """What the robot as a whole does."""

    HOLDS = "holds"
    """Brakes, stands, and moves again only when a person engages it."""
    WAITS = "holds until the clutch is pressed"
    """Brakes, stands, and goes on slowly when the operator, still holding the deadman, presses it."""
    HOLDS_JOINTS = "holds the joints concerned"
    """They brake and stand; the others go on."""
    GOES_ON = "goes on"
    """The robot goes on as if nothing had happened."""
    LIMITED = "follows within its limits"
    """It cannot tell that this is not meant, and moves no faster and no farther than it ever may."""
    STOPS = "emergency stop"
    """Brakes, stands, and does nothing until a person at the robot resets it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FaultRow:
    """A row of the table. Its texts are for the person at the robot; times count from the fault.

    `VirtualFault` and `ProcessFault` add how the fault is brought about.
    """

    name: str
    done: str
    """What is done in the trial."""
    reaction: Reaction
    robot: str
    """What the robot does, in plain words."""
    person: str
    """What a person does then."""
    reacts_s: float | None = None
    """The guard must be in its final state by then; None if the robot goes on."""
    stands_s: float | None = None
    """The affected joints must stand from then on; None if they go on."""
    strays_deg: float | None = None
    """How far the joints not concerned may be from where they would have been without the fault."""
    missed: str = ""
    """The part of the expected reaction that the robot does not keep yet; empty if it keeps all."""
