"""`[servos.canopen]`: the buses, and which drive turns which joint."""

from __future__ import annotations

from collections.abc import Collection, Mapping

from pydantic import Field

from common.can.config import BusConfig, names_used_twice
from common.clock import NS_PER_S
from common.errors import NOT_SET, ConfigMistake
from common.skeleton import Skeleton
from slave.encoders.counts import EncoderConfig
from slave.servos.backend import BackendConfig
from slave.servos.canopen.drive_config import (
    SAYS_NONE,
    DriveConfig,
    DriveSettings,
    EffortSource,
    NetworkTimes,
    TorqueLimitBy,
    limits_rad,
)
from slave.servos.canopen.eds_check import eds_mistakes
from slave.servos.canopen.emergency import SAFE_TORQUE_OFF
from slave.servos.canopen.load import (
    BUSIEST,
    WELL,
    bits_per_s,
    configured_bitrate,
    frame_bits,
    too_much,
)
from slave.servos.canopen.pdo import ENCODER, LIMITS

_INT32 = 2**31 - 1
MOST_SYNCS = 20
"""From one telling of a drive's effort to the next."""


def _two_groups() -> list[BusConfig]:
    options: dict[str, str | int | float | bool] = {"hop_limit": 0}
    return [
        BusConfig(name=name, interface="udp_multicast", channel=group, fd=False, options=options)
        for name, group in (("left", "239.74.163.21"), ("right", "239.74.163.22"))
    ]


class CanopenConfig(BackendConfig):
    """`[servos.canopen]`: all drives of the robot, moved by one SYNC."""

    buses: list[BusConfig] = Field(default_factory=_two_groups, min_length=1)
    """`[[servos.canopen.buses]]`; without any: two multicast groups of this host, for `tandem drives`."""
    drives: dict[str, DriveConfig] = Field(default_factory=dict)
    """The drives by joint: all of them or none. Without any, those of `tandem drives`: ids from 1 upwards in
    the order of the joints, the right side on the second bus if there is one, all else on the first."""
    tell_inputs: list[str] = Field(default_factory=list)
    """Joints whose drives also send their digital inputs (60FDh) at every SYNC, for `[[estop.inputs]]`."""
    sto_codes: list[int] = Field(default_factory=lambda: [SAFE_TORQUE_OFF])
    """Emergency codes by which the drives say that safe torque off (STO) is active; each maker has others."""
    sync_hz: int = Field(50, ge=10, le=200)
    """SYNC: targets out, positions in."""
    sample_error_ms: float = Field(0.3, ge=0.0, le=5.0)
    """A drive may read its angle so much before or after a punctual SYNC: by the frame that SYNC waits for
    (0.13 ms at 1 Mbit/s), and by its own control cycle where that is not locked to SYNC."""
    node_id: int = Field(127, ge=1, le=127)
    """The slave's own, of its heartbeat."""
    heartbeat_ms: int = Field(40, ge=10, le=1000)
    """Between two heartbeats of the slave, rounded down to whole SYNC periods, one at least."""
    dead_ms: int = Field(200, ge=50, le=5000)
    """A drive that misses the slave's heartbeat for this time stops by itself and holds."""
    drive_heartbeat_ms: int = Field(100, ge=20, le=5000)
    """Between two heartbeats of a drive."""
    drive_dead_ms: int = Field(350, ge=50, le=10_000)
    """A drive that is silent for this time is lost."""
    tell_effort: bool = True
    """False: no drive is asked for its effort."""
    effort_every: int | None = Field(None, ge=1, le=MOST_SYNCS)
    """SYNCs from one telling of a drive's effort to the next. None: as few as the buses carry well."""
    following_error_deg: float = Field(20.0, gt=0.0, le=180.0)
    """At the joint: further than this from its target for `following_error_ms` a drive faults."""
    following_error_ms: int = Field(200, ge=1, le=10_000)
    fault_reset: bool = True
    """Whether a start, or a reset after an e-stop, may reset a drive's fault. False: only at the drive."""
    join_deg_s: float = Field(15.0, gt=0.0, le=90.0)
    """A drive that has just been enabled goes from where it stands to its setpoint at most so fast."""
    start_timeout_s: float = Field(10.0, gt=0.0, le=120.0)
    """All drives configured and enabled within, or the slave does not start."""

    @property
    def period_ns(self) -> int:
        """Between two SYNCs."""
        return NS_PER_S // self.sync_hz

    @property
    def bus_lag_s(self) -> float:
        """A setpoint waits half a SYNC period; the drives then take a whole one to go there."""
        return 1.5 / self.sync_hz

    def drives_of(self, skeleton: Skeleton) -> dict[str, DriveConfig]:
        """One drive a joint, in the order of the joints."""
        drives = self._wired(skeleton)
        if self.tell_effort:
            return drives
        silent = {"effort": EffortSource.NONE}
        return {name: drive.model_copy(update=silent) for name, drive in drives.items()}

    def _wired(self, skeleton: Skeleton) -> dict[str, DriveConfig]:
        if self.drives:
            return {name: self.drives[name] for name in skeleton.joint_names}
        last = self.buses[-1].name
        used: dict[str, int] = {}
        drives = {}
        for name in skeleton.joint_names:
            bus = last if name.startswith("right_") else self.buses[0].name
            used[bus] = used.get(bus, 0) + 1
            drives[name] = DriveConfig(id=used[bus], bus=bus, encoder=ENCODER)
        return drives

    def settings(self, skeleton: Skeleton) -> list[DriveSettings]:
        """What each drive is told, in the order of the joints."""
        times = NetworkTimes(
            node_id=self.node_id,
            dead_ms=self.dead_ms,
            heartbeat_ms=max(self.heartbeat_ms, 1000 // self.sync_hz),
            drive_heartbeat_ms=self.drive_heartbeat_ms,
            period_ms=1000 // self.sync_hz,
            effort_syncs=self.effort_syncs(skeleton),
            following_error_deg=self.following_error_deg,
            following_error_ms=self.following_error_ms,
        )
        drives = self.drives_of(skeleton).values()
        return [
            DriveSettings.of(drive, joint, times, joint.name in self.tell_inputs)
            for drive, joint in zip(drives, skeleton.joints, strict=True)
        ]

    def single_reading(self, skeleton: Skeleton) -> Collection[str]:
        """Joints without an encoder at the output."""
        return [name for name, drive in self.drives_of(skeleton).items() if drive.encoder is None]

    def no_effort(self, skeleton: Skeleton) -> dict[str, str]:
        """Joints whose drives are not asked."""
        drives = self.drives_of(skeleton).items()
        return {name: SAYS_NONE for name, drive in drives if drive.effort is EffortSource.NONE}

    def effort_syncs(self, skeleton: Skeleton) -> int:
        """Every how many SYNCs drives tell their effort: it must not crowd out what moves them."""
        if self.effort_every is not None:
            return self.effort_every
        rates = {bus.name: configured_bitrate(bus) for bus in self.buses}

        def fits(every: int, share: float) -> bool:
            loads = self._load(skeleton, every)
            return all(bits <= share * rates[name] for name, (_, bits) in loads.items())

        counts = range(1, MOST_SYNCS + 1)
        fitting = [every for share in (WELL, BUSIEST) for every in counts if fits(every, share)]
        return next(iter(fitting), MOST_SYNCS)

    def load(self, skeleton: Skeleton) -> dict[str, tuple[int, float]]:
        """The number of drives on each bus, and the bits per second that they put on it."""
        return self._load(skeleton, self.effort_syncs(skeleton))

    def _load(self, skeleton: Skeleton, every: int) -> dict[str, tuple[int, float]]:
        drives = self.drives_of(skeleton).items()
        beat_ms = max(self.heartbeat_ms, 1000 // self.sync_hz)
        loads = {}
        for bus in self.buses:
            here = {name: drive for name, drive in drives if drive.bus == bus.name}
            inputs = sum(name in self.tell_inputs for name in here)
            efforts = sum(drive.effort is not EffortSource.NONE for drive in here.values()) / every
            limits = sum(
                frame_bits(2 * len(LIMITS[drive.torque_limit.value]))
                for drive in here.values()
                if drive.torque_limit is not TorqueLimitBy.NONE
            )
            beats = beat_ms, self.drive_heartbeat_ms
            loads[bus.name] = len(here), bits_per_s(len(here), self.sync_hz, *beats, inputs, efforts, limits)
        return loads

    def mistakes_for(self, skeleton: Skeleton, encoders: EncoderConfig) -> list[ConfigMistake]:
        """Joints without a drive, drives without a joint, ids used twice, times that do not fit."""
        key = "servos.canopen"
        mistakes = names_used_twice(self.buses, f"{key}.buses")
        if self.dead_ms < 3 * max(self.heartbeat_ms, 1000 // self.sync_hz):
            expected = "at least three heartbeats and three SYNC periods"
            mistakes.append(ConfigMistake(f"{key}.dead_ms", self.dead_ms, expected))
        if self.drive_dead_ms < 3 * self.drive_heartbeat_ms:
            expected = "at least three times drive_heartbeat_ms"
            mistakes.append(ConfigMistake(f"{key}.drive_dead_ms", self.drive_dead_ms, expected))
        if 1000 % self.sync_hz:
            expected = "a rate whose period is whole milliseconds: 10, 20, 25, 40, 50, 100, 125 or 200"
            mistakes.append(ConfigMistake(f"{key}.sync_hz", self.sync_hz, expected))
        for name in self.drives:
            if name not in skeleton.joint_names:
                expected = f"a joint of the {skeleton.name} profile"
                mistakes.append(ConfigMistake(f"{key}.drives.{name}", name, expected))
        for name in self.tell_inputs:
            if name not in skeleton.joint_names:
                expected = f"joints of the {skeleton.name} profile"
                mistakes.append(ConfigMistake(f"{key}.tell_inputs", name, expected))
        missing = [name for name in skeleton.joint_names if self.drives and name not in self.drives]
        mistakes += [
            ConfigMistake(f"{key}.drives.{name}", NOT_SET, "a drive for each joint") for name in missing
        ]
        if not missing and not mistakes:
            mistakes += self._wiring(self.drives_of(skeleton), skeleton)
            mistakes += self._busy(skeleton)
            names = skeleton.joint_names
            mistakes += eds_mistakes(zip(names, self.settings(skeleton), strict=True))
        return mistakes

    def _busy(self, skeleton: Skeleton) -> list[ConfigMistake]:
        loads = self.load(skeleton)
        overloaded = [
            (bus.name, too_much(count, self.sync_hz, bits, configured_bitrate(bus)))
            for bus in self.buses
            for count, bits in (loads[bus.name],)
        ]
        return [
            ConfigMistake("servos.canopen.sync_hz", self.sync_hz, f"what bus {name} can carry: {words}")
            for name, words in overloaded
            if words
        ]

    def _wiring(self, drives: Mapping[str, DriveConfig], skeleton: Skeleton) -> list[ConfigMistake]:
        names = [bus.name for bus in self.buses]
        taken: dict[tuple[str, int], str] = dict.fromkeys(((n, self.node_id) for n in names), "the slave")
        mistakes = []
        for joint in skeleton.joints:
            drive, key = drives[joint.name], f"servos.canopen.drives.{joint.name}"
            if drive.bus not in names:
                mistakes.append(ConfigMistake(f"{key}.bus", drive.bus, f"one of {', '.join(names)}"))
            other = taken.setdefault((drive.bus, drive.id), joint.name)
            if other != joint.name:
                mistakes.append(ConfigMistake(f"{key}.id", drive.id, f"an id that {other} does not have"))
            if drive.torque_limit is not TorqueLimitBy.NONE and drive.most_torque_percent is None:
                expected = "the drive's greatest torque, as torque_limit needs it"
                mistakes.append(ConfigMistake(f"{key}.most_torque_percent", NOT_SET, expected))
            lower, upper = limits_rad(drive, joint.lower_rad, joint.upper_rad)
            if lower >= upper:
                mistakes.append(ConfigMistake(f"{key}.lower_deg", drive.lower_deg, "less than upper_deg"))
            furthest = max(abs(lower), abs(upper)) * abs(drive.increments_per_rad) + abs(
                drive.zero_increments
            )
            if furthest > _INT32 and not drive.counts_over:
                expected = (
                    "the joint's whole range within the drive's 32 bits of increments: beyond them a target "
                    "leads the long way round; set its home offset (607Ch), or fewer increments a turn, or "
                    "counts_over = true if the drive counts over and takes targets so"
                )
                mistakes.append(ConfigMistake(f"{key}.gear_ratio", drive.gear_ratio, expected))
            elif (upper - lower) * abs(drive.increments_per_rad) > _INT32:
                expected = "less than 2³¹ increments over the joint's range: fewer increments a turn"
                mistakes.append(ConfigMistake(f"{key}.gear_ratio", drive.gear_ratio, expected))
        return mistakes
