"""What each process publishes about itself: one typed tree, one encoder, one decoder. Pure.

Everything that reads a figure of another process reads an attribute of these classes. A field that is renamed
or that is missing fails the type checker, and on arrival the decoder: it never becomes a zero.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any, TypeVar

from pydantic import ConfigDict, TypeAdapter, ValidationError

from common.errors import CodecError

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

# a field that nobody knows is a renamed one: it is refused, as a missing one is
_STRICT = ConfigDict(extra="forbid", allow_inf_nan=False)


class Metrics:
    """Base of every part of the tree."""

    __slots__ = ()
    __pydantic_config__ = _STRICT


@dataclass(frozen=True, slots=True)
class Summary(Metrics):
    """A distribution of durations, in ms. The figures are None where nothing was recorded."""

    count: int
    mean: float | None = None
    p50: float | None = None
    p99: float | None = None
    max: float | None = None
    bound: float | None = None
    """Half-width of the clock offset's bound, for a stage that crosses from one clock to the other."""

    @property
    def total(self) -> float:
        """The sum of all durations, in ms."""
        return self.count * self.mean if self.mean is not None else 0.0


@dataclass(frozen=True, slots=True)
class Software(Metrics):
    """Versions that a process runs."""

    tandem: str
    schema: int
    """Of the messages."""
    zenoh: str
    python: str


@dataclass(frozen=True, slots=True)
class Ticks(Metrics):
    """Turns of a periodic loop since its start."""

    expected: int
    missed: int


@dataclass(frozen=True, slots=True)
class HeapMetrics(Metrics):
    """Memory that a process holds on to, beside which resident memory may hide a leak."""

    bytes_in_use: int | None
    """Allocated by C and not freed; None where the C library does not tell."""
    python_blocks: int
    """Objects of Python's own allocator."""
    python_threads: int


@dataclass(slots=True)
class TopicCounters(Metrics):
    """Counters of one topic in one session; they only grow."""

    sent: int = 0
    """Payloads that Zenoh took; under congestion it may still drop them."""
    put_errors: int = 0
    """Payloads that Zenoh refused."""
    received: int = 0
    """Payloads and questions that arrived."""
    overwritten: int = 0
    """Payloads that a newer one replaced before the loop came to them."""
    handler_errors: int = 0
    """Exceptions out of this side's own handlers."""
    answered: int = 0
    """Questions answered."""
    refused: int = 0
    """Questions turned away because too many were waiting."""
    asked: int = 0
    timeouts: int = 0
    """Questions that got no answer in time."""
    unanswered: int = 0
    """Questions that nobody was there to answer, or whose answerer reported an error."""


@dataclass(frozen=True, slots=True)
class RefusalMetrics(Metrics):
    """Connections and messages that access control refused."""

    total: int
    handshakes: dict[str, int]
    """By reason."""
    messages: dict[str, dict[str, int]]
    """By certificate, then by kind and key."""


@dataclass(frozen=True, slots=True)
class AccessMetrics(Metrics):
    """Who is connected, and who was refused."""

    connected: dict[str, int]
    connections: dict[str, int]
    refused: RefusalMetrics | None
    """None without [link.tls], where nothing is refused."""


# the master


@dataclass(frozen=True, slots=True)
class Unreached(Metrics):
    """How far a segment of the operator was beyond what the robot can reach."""

    percent: float
    """Share of all solved postures."""
    now_deg: float
    most_deg: float


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
    round_trip_recent_us: tuple[int, ...] = ()
    """Each round trip since the message before; in messages only, not in the file at the end."""


@dataclass(frozen=True, slots=True)
class MasterMetrics(Metrics):
    """The master's process. A message to a robot tells of that robot alone."""

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
    buses: dict[str, dict[str, bool | int | str]]
    """Each bus's counters and last error (`common.can.bus.CanBus.summary`)."""
    robots: dict[str, CommandedMetrics]
    access: AccessMetrics | None = None
    """In the file at the end only."""


# the slave


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
    late_steps: int


@dataclass(frozen=True, slots=True)
class LeaseMetrics(Metrics):
    """The lease that is in force."""

    operator: str
    id: int
    held_s: float
    renewed_s: float


@dataclass(frozen=True, slots=True)
class ArrivalCounts(Metrics):
    """Commands of the lease's holder, by their numbers."""

    arrived: int
    lost: int
    late: int
    repeated: int


@dataclass(frozen=True, slots=True)
class DueMetrics(Metrics):
    """Commands of the lease's holder, by time: also those that nobody sent."""

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


@dataclass(frozen=True, slots=True)
class ServoMetrics(Metrics):
    """A servo backend: whatever it counts and times, by name."""

    counters: dict[str, int] = field(default_factory=dict)
    times_ms: dict[str, Summary] = field(default_factory=dict)
    buses: dict[str, dict[str, bool | int | str]] = field(default_factory=dict)


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
    gave_way: int
    unseen: int
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
    access: AccessMetrics | None = None
    """In the file at the end only."""


# the simulated suit and the recorder: files only


@dataclass(frozen=True, slots=True)
class SuitMetrics(Metrics):
    """The simulated suit's process."""

    syncs: int
    malformed_syncs: int
    ticks: int
    frames: int
    stale_syncs: int
    buses: dict[str, dict[str, bool | int | str]]


@dataclass(frozen=True, slots=True)
class RecorderMetrics(Metrics):
    """`tandem record`."""

    recorded: dict[str, int]
    """Messages, by topic."""
    files: list[str]
    put: int
    written: int
    refused: int
    lost: int
    failed: str
    overwritten: int
    """Messages that a newer one replaced before they were taken."""
    missing: dict[str, int]
    """Messages that never came, by their own numbers, by topic."""


_Part = TypeVar("_Part")


def to_tree(metrics: DataclassInstance) -> dict[str, object]:
    """Plain values, for msgpack and JSON. A number that is not finite becomes None."""
    return {name: _plain(value) for name, value in asdict(metrics).items()}


def from_tree(kind: type[_Part], tree: object) -> _Part:
    """The metrics of plain values. CodecError names the first field that is missing, unknown or wrong."""
    try:
        part: _Part = _adapter(kind).validate_python(tree)
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False)[0]
        where = ".".join(str(part) for part in first["loc"])
        raise CodecError(f"{kind.__name__}: {where}: {first['msg'].lower()}") from None
    return part


_ADAPTERS: dict[type, TypeAdapter[Any]] = {}
"""Made when first used: each takes some ms."""


def _adapter(kind: type) -> TypeAdapter[Any]:
    if kind not in _ADAPTERS:
        _ADAPTERS[kind] = TypeAdapter(kind)
    return _ADAPTERS[kind]


def _plain(value: object) -> object:
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
