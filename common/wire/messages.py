"""What travels between the two sides. Times are ns of the sender's own monotonic clock unless named."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from common.metrics.master import MasterMetrics
from common.metrics.slave import SlaveMetrics
from common.quaternion import Array

Mask = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class CommandStamps:
    """When a command passed each station on the master, ns of the master's clock."""

    sampled_ns: int
    """SYNC sent: the nodes sample on it."""
    frames_in_ns: int
    """Last frame of the deciding tick arrived, or its window closed."""
    angles_ns: int
    """Joint angles known."""
    put_ns: int
    """Handed to the link."""


@dataclass(frozen=True, slots=True)
class Command:
    """The operator's posture, master → slave, 12.5 Hz or as negotiated."""

    robot: str
    lease: int
    """Token of the lease that the slave granted this master; 0 where it has none."""
    sequence: int
    """Counts up by one within a lease."""
    tick: int
    """Capture tick that decided it; the suit's truth carries the same number."""
    stamps: CommandStamps
    deadman_held: bool
    valid: Mask
    """(J,) False where a joint's nodes are lost: the slave holds just those."""
    position_rad: Array
    velocity_rad_s: Array
    seen_frame: int = 0
    """Number of the newest video frame that the operator had seen when he moved so; 0 where there is none."""
    seen_ns: int = 0
    """When that frame arrived, ns of the master's clock; 0 where there is none."""
    doubt: str = ""
    """Why nobody should engage on this posture, in words (a zero pose that was not taken, a node that lies);
    empty where the operator's side has nothing against it."""
    clutch_out: bool = False
    """The operator has released the clutch: he repositions himself, and is not to be followed meanwhile."""
    period_ms: int = 0
    """Until the next one is due, as the rate in force has it; 0 where the sender does not say."""
    operator: str = ""
    """On whose key it arrived (`common.wire.sender`). Not on the wire: the receiver fills it in."""


@dataclass(frozen=True, slots=True)
class CommandEcho:
    """The stamps of the newest accepted command, sent back so that round trips close on one clock."""

    sequence: int
    put_ns: int
    """Master's clock."""
    received_ns: int
    """Slave's clock, as all that follow."""
    accepted_ns: int
    written_ns: int


@dataclass(frozen=True, slots=True)
class BaseAttitude:
    """How the robot's base stands (paper D), from its own accelerometer and magnetometer."""

    measured_ns: int
    """Slave's clock."""
    inclination_rad: float
    """Of the base's axis from the vertical, 0 to π."""
    azimuth_rad: float | None
    """True azimuth of the axis's horizontal projection, 0 to 2π; None where it has no direction."""
    tool_face_rad: float | None
    """Rotation about the axis itself, 0 to 2π; None where neither gravity nor field determines it."""
    tilt_rad: float
    """Of the base from level, 0 to π: whatever its axis is, this is what it falls over by."""


@dataclass(frozen=True, slots=True)
class RobotState:
    """What the robot does, slave → master, 50 Hz."""

    robot: str
    sequence: int
    sent_ns: int
    encoder_ns: int
    """When the encoders were read."""
    guard: str
    """Name of the guard's state."""
    reason: str
    """Why the guard is there, in words."""
    operator: str
    """Name of the operator who holds the lease; empty if none."""
    encoder_valid: Mask
    position_rad: Array
    """(J,) measured by the encoders."""
    setpoint_rad: Array
    """(J,) last written to the servos."""
    echo: CommandEcho | None
    master_offset_ns: int
    """Master's clock minus the slave's, as the slave measured it."""
    offset_bound_ns: int
    """Half-width of its bound; negative where the offset is not trusted."""
    faults: dict[str, str] = field(default_factory=dict)
    """What is wrong with the robot's body, in words: by joint, or `base`, `camera`."""
    base: BaseAttitude | None = None
    """None where the base carries no sensor, or it has never answered."""
    lease_id: int = 0
    """Which lease it is (`wire.lease.lease_id`): two masters may bear one name. 0 where there is none."""
    instance: int = 0
    """Which process sent it (`common.wire.instance`): two robots may have one name by mistake."""
    resting: tuple[str, ...] = ()
    """Joint groups that hold until the operator takes them up again."""
    effort_nm: Array | None = None
    """(J,) torque of each motor at the joint, N m; NaN where its drive tells none, None if no drive does."""
    external_nm: Array | None = None
    """(J,) torque from outside at the joint, N m, as the slave estimates it; NaN and None as above."""
    blind_m: tuple[float, ...] = ()
    """How far each hand (`slave.model.ends`) would be once all stand, if the line died at the newest command;
    () while the robot follows nobody."""
    blind_s: float = 0.0
    """When all would stand, from that command on."""
    clamped: Mask | None = None
    """(J,) joints that a limit has held back since the state before; None where it was none."""
    wanted_period_ms: int = 0
    """Between two commands, as the robot's line lets it ask for; 0 where the robot does not say."""


class Action(StrEnum):
    """What a person or a master can ask of a robot."""

    CLAIM = "claim"
    RELEASE = "release"
    ENGAGE = "engage"
    DISENGAGE = "disengage"
    ESTOP = "estop"
    RESET = "reset"
    STATUS = "status"
    NAMESAKE = "namesake"
    """Another robot of this name answers too: its holder of the lease says so, and the robot holds."""
    HOME = "home"
    """Confirm, with the key, that the robot stands as it says, where nothing else can."""
    TAKE = "take"
    """The operator's own master shall claim the robot. Nothing moves before an engage."""
    HANDOVER = "handover"
    """The holder of the lease offers it to another operator; the robot holds."""
    REST = "rest"
    """Joint groups hold where they are; the others follow."""
    TAKE_UP = "take-up"
    """Joint groups that rest follow the operator again, slowly at first."""


@dataclass(frozen=True, slots=True)
class StateHead:
    """A `RobotState` without its joints, for who does not look at them: a third of the cost to decode."""

    sequence: int
    sent_ns: int
    guard: str
    reason: str
    operator: str
    echo: CommandEcho | None
    faults: dict[str, str]
    resting: tuple[str, ...]
    lease_id: int
    instance: int
    wanted_period_ms: int


SaidOfRobot = RobotState | StateHead
"""What a master that commands the robot hears of it."""


@dataclass(frozen=True, slots=True)
class ControlRequest:
    """A question to the slave that must be answered."""

    robot: str
    action: Action
    operator: str
    """Who asks; `engage` and `disengage` are for the lease holder's name only."""
    key: str = ""
    """The reset key, for `reset` and `home`; where the other is, for `namesake`; to whom, for `handover`;
    `together` for an `engage` that shall move this robot beside others (`common.wire.together`)."""
    clock: int = 0
    """For `claim`: the asker of the clock queries that measure the clock of this master's stamps."""
    challenge: int = 0
    """Where motion may follow: the one of the robot's last `status`. Else a late request would count."""
    groups: tuple[str, ...] = ()
    """For `rest` and `take-up`: which joint groups (`common.skeleton.groups`)."""


@dataclass(frozen=True, slots=True)
class ControlReply:
    """What happened, and why not."""

    done: bool
    guard: str
    text: str
    lease: int = 0
    """The token granted, for `claim`."""
    challenge: int = 0
    """For `status`: what an `engage` or `reset` must quote soon, once."""
    instance: int = 0
    """Which process answers (`common.wire.instance`): two robots may bear one name by mistake."""
    place: str = ""
    """Where that process is, in words: host and endpoints."""


@dataclass(frozen=True, slots=True)
class ClockReference:
    """What a time service states of its host's clock: reference minus clock, and how wrong that may be."""

    at_ns: int
    """When, by the sender's clock."""
    ahead_ns: int
    """Reference minus the sender's clock at that moment."""
    error_ns: int
    """Half-width of what the service states, and of reading the clocks."""
    rate_ppb: int
    """By how much `ahead_ns` grows, ns a second."""
    rate_error_ppb: int
    """Half-width of that."""
    source: str
    """`chrony` or `ptp`."""
    scale: str
    """What the reference counts: `utc`, or one PTP grandmaster. Only equal ones compare."""


@dataclass(frozen=True, slots=True)
class ClockQuery:
    """Master → slave. Carries the end of the last exchange, so that the slave can measure too."""

    asked_ns: int
    """t1, master's clock."""
    last_asked_ns: int = 0
    """t1 of the exchange before, 0 where there was none."""
    last_heard_ns: int = 0
    """t4 of the exchange before."""
    asker: int = 0
    """A number that only this asker uses; 0 where it has none."""
    reference: ClockReference | None = None
    """What the master's time service states; None where none does."""


@dataclass(frozen=True, slots=True)
class ClockReply:
    """Slave → master."""

    asked_ns: int
    """t1, returned."""
    received_ns: int
    """t2, slave's clock."""
    replied_ns: int
    """t3, slave's clock."""
    instance: int = 0
    """Whose clock it is."""
    reference: ClockReference | None = None
    """What the slave's time service states; None where none does."""


@dataclass(frozen=True, slots=True)
class Statistics:
    """What one process counted and measured, 1 Hz, for tables and reports."""

    sent_ns: int
    metrics: MasterMetrics | SlaveMetrics


@dataclass(frozen=True, slots=True)
class Truth:
    """The simulated operator's true joint angles: for judging, never read by either pipeline."""

    tick: int
    sampled_ns: int
    """Suit's clock."""
    position_rad: Array
    velocity_rad_s: Array


Message = Command | RobotState | ControlRequest | ControlReply | ClockQuery | ClockReply | Statistics | Truth
