"""What can happen in a soak: one dataclass for each kind of line in `events.jsonl`.

Every field has a default, so that a recording of an older tandem is read too. A default is not written.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from typing import ClassVar

from pydantic import TypeAdapter


@dataclass(frozen=True, slots=True)
class Happening:
    """Any kind of event."""

    kind: ClassVar[str] = ""

    def written(self) -> dict[str, object]:
        """What differs from the defaults, as JSON values; seconds to the millisecond."""
        plain = asdict(self)
        defaults = {f.name: f.default for f in fields(self)}
        return {
            name.rstrip("_"): round(value, 3) if isinstance(value, float) else value
            for name, value in plain.items()
            if value != defaults[name] and value != {}
        }


@dataclass(frozen=True, slots=True)
class NetworkNature:
    """What an emulated network does without losing anything."""

    name: str = ""
    way_s: float = 0.0
    """The longest that a packet to the robot takes, without queues."""
    max_age_s: float | None = None
    """The guard's age limit over this network; None: the guard's own."""


@dataclass(frozen=True, slots=True)
class SoakBegun(Happening):
    """The first line: what was asked for."""

    kind = "begin"
    duration_s: float = 0.0
    transport: str = ""
    profile: str | None = None
    router: bool = False
    faults: tuple[str, ...] = ()
    every_s: float | None = None
    seed: int | None = None
    left_out: Mapping[str, str] = field(default_factory=dict)
    robot_profile: str = "nursing"
    """Faults that cannot be brought about here, and why."""
    network: NetworkNature | None = None


@dataclass(frozen=True, slots=True)
class RobotFollowed(Happening):
    """The robot follows for the first time."""

    kind = "follows"
    planned: int = 0
    """Faults to come."""


@dataclass(frozen=True, slots=True)
class ProcessStarted(Happening):
    """A process was started, for the first time or again."""

    kind = "started"
    process: str = ""
    life: int = 0


@dataclass(frozen=True, slots=True)
class ProcessEnded(Happening):
    """A process ended by itself."""

    kind = "ended"
    process: str = ""
    words: str = ""
    """The last that it logged."""


@dataclass(frozen=True, slots=True)
class GuardChanged(Happening):
    """The guard's state."""

    kind = "guard"
    from_: str = ""
    to: str = ""
    reason: str = ""


@dataclass(frozen=True, slots=True)
class LeaseChanged(Happening):
    """The holder of the lease."""

    kind = "lease"
    operator: str = ""
    id: int = 0


@dataclass(frozen=True, slots=True)
class JointsUnknown(Happening):
    """How many joints the master does not know."""

    kind = "joints"
    unknown: int = 0


@dataclass(frozen=True, slots=True)
class EngageAnswered(Happening):
    """The robot answered a request to engage."""

    kind = "engage"
    done: bool = False
    text: str = ""


@dataclass(frozen=True, slots=True)
class FaultCourse(Happening):
    """One fault: what it asks of the robot, and what the robot did. Times in seconds; None: never."""

    fault: str = ""
    """Its name; empty where the robot left track by itself."""
    number: int = -1
    holds: bool = False
    """Whether the robot must hold."""
    heard: bool = False
    """Whether the robot can be heard meanwhile."""
    notices_s: float = 0.0
    """How long the master needs to notice the fault."""
    flow_limit_s: float | None = None
    begun_s: float = 0.0
    held_s: float | None = None
    stands_s: float | None = None
    failed: str = ""
    """Why the fault could not be brought about."""
    step_s: int | None = None
    """By how much a clock was stepped."""
    node: str = ""
    disk: str = ""


@dataclass(frozen=True, slots=True)
class FaultBegun(FaultCourse):
    """A fault begins."""

    kind = "fault"
    lasts_s: float = 0.0


@dataclass(frozen=True, slots=True)
class FaultUndone(FaultCourse):
    """A fault is over; the robot still has to come back."""

    kind = "undone"


@dataclass(frozen=True, slots=True)
class FaultRecovered(FaultCourse):
    """The robot came back after a fault, or did not come back in time."""

    kind = "recovered"
    done: bool = False
    flow_s: float | None = None
    """From the end of the fault until the robot accepted a command again."""
    ready_s: float | None = None
    """From the end of the fault until the robot could be engaged; None too where it never left track."""
    track_s: float | None = None
    """From the last engagement until the robot tracked."""
    engaged: int = 0
    """How often it was engaged."""
    refused: str = ""
    """What it last answered when it did not engage."""


@dataclass(frozen=True, slots=True)
class BlindWayMeasured(Happening):
    """How far a hand went after the last command before a hold for want of commands."""

    kind = "blind"
    hand: str = ""
    foretold_cm: float = 0.0
    measured_cm: float = 0.0
    """At the encoders."""


@dataclass(frozen=True, slots=True)
class RobotLeft(Happening):
    """The robot left track without a fault."""

    kind = "left"
    guard: str = ""
    reason: str = ""
    known: bool = False
    """Whether the master knew every joint."""


@dataclass(frozen=True, slots=True)
class HostStalled(Happening):
    """The host stalled."""

    kind = "still"
    from_s: float = 0.0
    still_ms: float = 0.0
    excused_ms: float = 0.0
    """The part of it that is shown to be the host's own."""
    evidence: str = ""


@dataclass(frozen=True, slots=True)
class RecordingChecked(Happening):
    """What the recorder left when it ended."""

    kind = "recording"
    after: str = ""
    """`stop`, `kill` or `disk full`."""
    readable: bool = False
    messages: int = 0
    size_mb: float = 0.0
    cut: str = ""
    lost_s: float | None = None
    """From the last message to the kill."""
    why_not: str = ""
    lived: bool = False
    """Whether the recorder outlived its full disk."""
    said: int = 0
    """How often it logged that its disk was full."""
    status: int | None = None


@dataclass(frozen=True, slots=True)
class SoakEnded(Happening):
    """The last line."""

    kind = "end"
    how: str = ""
    error: bool = False
    status: Mapping[str, int | None] = field(default_factory=dict)
    """Exit status by process; None where it did not run."""


_KINDS = (
    SoakBegun, RobotFollowed, ProcessStarted, ProcessEnded, GuardChanged, LeaseChanged, JointsUnknown,
    EngageAnswered, FaultBegun, FaultUndone, FaultRecovered, RobotLeft, BlindWayMeasured, HostStalled,
    RecordingChecked, SoakEnded,
)  # fmt: skip
_READERS: Mapping[str, TypeAdapter[Happening]] = {each.kind: TypeAdapter(each) for each in _KINDS}


def happening(kind: str, tree: Mapping[str, object]) -> Happening:
    """A line's happening. Raises KeyError for an unknown kind, ValueError for values of another type."""
    return _READERS[kind].validate_python({"from_" if key == "from" else key: v for key, v in tree.items()})
