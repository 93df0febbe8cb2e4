"""What the slave publishes about itself."""

from __future__ import annotations

from dataclasses import dataclass, field

from common.metrics.bus import BusMetrics
from common.metrics.lens import Lens
from common.metrics.link import AccessMetrics, TopicCounters
from common.metrics.parts import HeapMetrics, Software, Summary, Ticks
from common.metrics.tree import Metrics


@dataclass(frozen=True, slots=True)
class GuardMetrics(Metrics):
    """What the guard did since the start."""

    state: str
    reason: str
    received: int
    accepted: int
    dropped: dict[str, int]
    """Refused commands, by gate."""
    losses: dict[str, int]
    """Holds, by what was lost."""
    clamps: dict[str, int]
    """Clamps begun, by rule."""
    doubts: dict[str, int]
    """Times that a joint was held because its encoder was not believed, by joint."""
    foreign_requests: int
    """Requests in another operator's name than that of the key on which they came: refused."""
    late_steps: int


@dataclass(frozen=True, slots=True)
class GuardTimes(Metrics):
    """The guard's times in force, and what they follow from; None where nothing is known of the line yet."""

    max_age_s: float
    command_timeout_s: float
    max_age_ceiling_s: float
    command_timeout_ceiling_s: float
    needs_age_s: float | None
    """What this line would need: beyond the ceiling it is refused."""
    needs_timeout_s: float | None
    one_way_s: float | None
    """Median, put to received."""
    bound_s: float | None
    """The clock offset's, which is added to every age."""
    jitter_s: float | None
    """By how much the age that 85 % of the commands kept exceeds the median."""
    words: str
    """In force, and why."""
    beyond: str
    """Which ceiling the line exceeds; empty where none."""


@dataclass(frozen=True, slots=True)
class RateMetrics(Metrics):
    """The rate of the commands of the lease's holder; see `slave/command_rate.py`."""

    hz: float | None
    """In force, as the newest command says; None where it says nothing."""
    wanted_hz: float | None
    """What this robot's line lets it ask for."""
    falls: int
    """Times that it asked for the usual rate again, because of loss or jitter."""
    words: str
    """Why."""


@dataclass(frozen=True, slots=True)
class LeaseMetrics(Metrics):
    """The lease that is in force."""

    operator: str
    id: int
    held_s: float
    renewed_s: float
    offered_to: str = ""
    """The operator who may take it; empty: nobody."""
    offer_left_s: float = 0.0


@dataclass(frozen=True, slots=True)
class ArrivalCounts(Metrics):
    """Commands of the lease's holder, by their numbers."""

    arrived: int
    lost: int
    late: int
    repeated: int


@dataclass(frozen=True, slots=True)
class DueMetrics(Metrics):
    """Commands of the lease's holder, by time: also those that were never sent."""

    expected: int
    """Came, or should have come between two that did."""
    missing: int
    """Was not there when it was due and a newer came, lost or never sent; the late ones are among them."""


@dataclass(frozen=True, slots=True)
class OffsetMetrics(Metrics):
    """The master's clock minus the slave's."""

    offset_ms: float
    bound_ms: float
    trusted: bool
    source: str = "round trip"
    """Whose bound it is: `round trip`, `chrony`, `ptp`, `chrony and ptp`."""
    words: str = ""
    """Which bound is in use, and why."""
    round_trip_bound_ms: float = 0.0
    """Half the round trip: what the guard goes by."""
    contradictions: int = 0
    """Statements of a time service that the round trip refuted."""
    clock_steps: int = 0
    """Times that this host's own reference clock was set, or jumped by a leap second."""


@dataclass(frozen=True, slots=True)
class ServoMetrics(Metrics):
    """A servo backend: whatever it counts and times, by name."""

    counters: dict[str, int] = field(default_factory=dict)
    times_ms: dict[str, Summary] = field(default_factory=dict)
    buses: dict[str, BusMetrics] = field(default_factory=dict)
    no_effort: dict[str, str] = field(default_factory=dict)
    """Why a joint's effort is not known, by joint: there is no contact detection there."""
    unlimited: str = ""
    """Why the drives may push harder than moving needs; empty where they may not."""
    no_torque_limit: dict[str, str] = field(default_factory=dict)
    """Why the drive of a joint takes no torque limit, by joint, where others do."""
    left_out: dict[str, str] = field(default_factory=dict)
    """What a joint's drive lacks that it may lack, in words."""
    not_driven: dict[str, str] = field(default_factory=dict)
    """Joints without a servo, and what their angle is, in words."""


@dataclass(frozen=True, slots=True)
class CameraMetrics(Metrics):
    """The camera's feed: rates of the last seconds, counters, times."""

    pictures: int
    fps: float
    kb_s: float
    mean_kb: float
    width: int
    sent_kb: float
    budget_bytes: int
    bitrate_reduced: int
    """Times that the picture's budget was made smaller."""
    not_acknowledged: int
    """Pictures that the master did not acknowledge."""
    make_ms: Summary
    transit_ms: Summary
    action_to_observation_ms: Summary
    fault: str
    """Why there is no picture; empty while all is well."""


@dataclass(frozen=True, slots=True)
class SlaveMetrics(Metrics):
    """The slave's process."""

    software: Software
    instance: int
    """A number that only this process bears."""
    heap: HeapMetrics
    ticks: Ticks
    guard: GuardMetrics
    lease: LeaseMetrics | None
    stages_ms: dict[str, Summary]
    end_to_end_ms: Summary
    one_way_ms: Summary
    """Of the commands that came."""
    one_way_corrected_ms: Summary
    """The same with every command that was due and did not come: how long the robot went without it."""
    commands: ArrivalCounts
    due: DueMetrics
    early: int
    """One-way times below zero by the measured offset, taken as zero."""
    unmoved: int
    offset: OffsetMetrics
    undecodable: dict[str, int]
    base: dict[str, int]
    """Counters of the base's attitude sensor; {} without one."""
    servos: ServoMetrics
    video: CameraMetrics | None
    link: dict[str, TopicCounters]
    one_way_recent_us: tuple[int, ...] = ()
    """Each one-way time since the message before; in messages only, not in the file at the end."""
    one_way_missing_recent_us: tuple[int, ...] = ()
    """What `one_way_corrected_ms` took for each command that did not come; likewise in messages only."""
    contact_from: str = ""
    """Below which force no push is noticed, by segment, in words; empty where none is at all."""
    times: GuardTimes | None = None
    rate: RateMetrics | None = None
    paths: str = ""
    """Of two paths, which one does not carry and why; see `[link.twin]`."""
    other_videos: dict[str, CameraMetrics] = field(default_factory=dict)
    """Of the cameras beside the main one, by name."""
    lenses: dict[str, Lens] = field(default_factory=dict)
    """How each camera sees the robot, by name, as far as it is known."""
    access: AccessMetrics | None = None
    """In the file at the end only."""
