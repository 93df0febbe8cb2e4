"""One row of the fault matrix: what is done, what the robot must do, and how soon."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING

from slave.guard import State

if TYPE_CHECKING:
    from deploy.experiments.faults.scene import Scene
    from deploy.experiments.faults.setting import Setting


class Reaction(StrEnum):
    """What the robot as a whole does."""

    HOLDS = "holds"
    """Brakes, stands, and moves again only when a person engages it."""
    HOLDS_JOINTS = "holds the joints concerned"
    """They brake and stand; the others go on."""
    GOES_ON = "goes on"
    """As if nothing had happened."""
    LIMITED = "follows within its limits"
    """It cannot tell that this is not meant, and moves no faster and no farther than it ever may."""
    STOPS = "emergency stop"
    """Brakes, stands, and does nothing until a person at the robot resets it."""


@dataclass(frozen=True, slots=True)
class Fault:
    """A row. Texts are for the person who stands at the robot; times are counted from the fault."""

    name: str
    done: str
    """What is done in the trial."""
    reaction: Reaction
    robot: str
    """What the robot does, in plain words."""
    person: str
    """What a person does then."""
    act: Callable[[Scene], None]
    """Brings the fault about, in a robot that follows a reaching operator unless `begins` says otherwise."""
    begins: State = State.TRACK
    ends: State = State.HOLD
    """The guard's state afterwards."""
    setting: Setting | None = None
    """What differs from the usual scene from its beginning on; None: nothing."""
    reacts_s: float | None = None
    """The guard must have reached `ends` by then; None where it goes on."""
    stands_s: float | None = None
    """The joints concerned must stand by then, for good; None where they go on."""
    concerns: Callable[[Scene], set[str]] | None = None
    """The joints that are to stand; None: all."""
    sway_deg: float | None = None
    """How far a joint that stands may be shaken by those that go on; None: two counts of its encoder."""
    strays_deg: float | None = None
    """How far the joints not concerned may be from where they would have been without the fault."""
    refused_by: frozenset[str] = frozenset()
    """The gates that must have refused commands, `codec` being what reads them."""
    lasts_s: float | None = None
    """After this long `act` is undone; None: not within the trial."""
    missed: str = ""
    """What of this the robot does not keep yet, in words; empty where it keeps all."""
    held_by: frozenset[str] = frozenset()
    """The gates, watches and rules of the guard that hold the fault off: without them the row must fail."""
