"""What the master publishes about itself and the robots that it commands."""

from __future__ import annotations

from dataclasses import dataclass, field

from common.metrics.bus import BusMetrics
from common.metrics.link import AccessMetrics, TopicCounters
from common.metrics.parts import HeapMetrics, Software, Summary, Ticks
from common.metrics.tree import Metrics


@dataclass(frozen=True, slots=True)
class Unreached(Metrics):
    """How far a segment of the operator was beyond what the robot can reach."""

    percent: float
    """Share of all solved postures."""
    now_deg: float
    most_deg: float


@dataclass(frozen=True, slots=True)
class ZeroPoseTaken(Metrics):
    """The zero pose, taken again while the suit is worn."""

    taken: int
    refused: int
    why: str
    """What was wrong with the newest one, if it was refused."""
    moved_deg: dict[str, float]
    """By segment, how far its heading had moved apart from the suit's at the newest; below 1° left out."""


@dataclass(frozen=True, slots=True)
class ArmLoad(Metrics):
    """How an operator's arm was loaded."""

    raised_s: float
    """Of the last 900 s: the upper arm above 60°, or the hand above the shoulder."""
    held_s: float
    """For so long the upper arm has stood away from hanging without moving by 10°."""
    elevation_deg: float
    """Of the upper arm from hanging, now."""


@dataclass(frozen=True, slots=True)
class RobotHeard(Metrics):
    """What the master hears of a robot."""

    silent: bool
    times_lost: int
    undecodable: int
    missing: int
    """States that never came, by their numbers."""


@dataclass(frozen=True, slots=True)
class LeaseHeld(Metrics):
    """Whether the master holds a robot's lease, and what the robot last answered."""

    held: bool
    answer: str


@dataclass(frozen=True, slots=True)
class VideoReceived(Metrics):
    """Pictures of a robot's camera at the master."""

    received: int
    late: int
    undecodable: int
    not_shown: int = 0
    """Pictures of H.264 that could not be shown because one before them was lost."""


@dataclass(frozen=True, slots=True)
class CommandedMetrics(Metrics):
    """One robot as the master commands it."""

    commands_sent: int
    round_trip_ms: Summary
    robot: RobotHeard
    lease: LeaseHeld
    video: VideoReceived
    link: dict[str, TopicCounters]
    """By topic."""
    scaling: dict[str, float] = field(default_factory=dict)
    """By joint group, the share of the operator's motion that the robot makes (`[operator.scaling]`)."""
    round_trip_recent_us: tuple[int, ...] = ()
    """Each round trip since the message before; in messages only, not in the file at the end."""


@dataclass(frozen=True, slots=True)
class MasterMetrics(Metrics):
    """The master's process. A message to a robot holds that robot alone."""

    software: Software
    heap: HeapMetrics
    ticks: Ticks
    stages_ms: dict[str, Summary]
    frames_in_to_put_ms: Summary
    nodes: dict[str, dict[str, int]]
    """Each node's counters (`master.suit.health.NodeHealth`) that are not zero, by segment."""
    doubts: dict[str, str]
    """Why a node's readings are not believed, by segment."""
    beyond_reach: dict[str, Unreached]
    """Segments that the robot could not bring to the operator's posture, by segment."""
    switches: dict[str, str]
    """What the operator holds, in words: `deadman`, and `clutch` if there is one."""
    buses: dict[str, BusMetrics]
    """By name."""
    robots: dict[str, CommandedMetrics]
    access: AccessMetrics | None = None
    """In the file at the end only."""
    paths: str = ""
    """Of two paths, which one does not carry and why; see `[link.twin]`."""
    command_hz: float | None = None
    """Commands a second in force."""
    command_rate: str = ""
    """Which rate that is and why, in words."""
    zero_pose_again: ZeroPoseTaken | None = None
    arm_load: dict[str, ArmLoad] = field(default_factory=dict)
    """By arm."""
    operator: str = ""
    """Whose master it is: two may speak to one robot."""
    headings_deg: dict[str, tuple[float, float]] = field(default_factory=dict)
    """By segment, how far its heading is off against its neighbour's, and the standard deviation, °."""
