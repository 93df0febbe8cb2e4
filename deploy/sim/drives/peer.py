"""All simulated drives of one robot: frames and time in, frames out; no bus, no clock of its own."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from common.clock import NS_PER_MS, NS_PER_S
from common.quaternion import Array
from common.skeleton import Skeleton
from deploy.sim.drives.faults import DriveFault, PlannedDriveFault
from deploy.sim.drives.makers import Maker
from deploy.sim.drives.node import SimulatedDrive
from deploy.sim.drives.plant import Plant
from deploy.sim.drives.torque import ToldTorque
from slave.encoders.counts import EncoderConfig
from slave.servos.canopen import pdo
from slave.servos.canopen.cia402 import Power
from slave.servos.canopen.config import CanopenConfig
from slave.servos.canopen.units import counted_over, nearest_to

SendOn = Callable[[str, int, bytes], None]
"""(bus name, identifier, data)."""
_FOLLOWING_ERROR = (0x8611, 0x21)
_LOOK_NS = 10 * NS_PER_MS
"""Between two looks at heartbeats and following errors."""
_UNBOUNDED = 0xFFFF_FFFF
_WRONG_ZERO_RAD, _TWIN_RAD, _RUNS_AWAY_RAD_S = np.radians((30.0, 49.0, 60.0)).tolist()

log = logging.getLogger(__name__)


@dataclass(slots=True)
class DriveCounters:
    """Since the start."""

    syncs: int = 0
    faults: int = 0
    stopped_by_themselves: int = 0
    """Drives that lost the slave's heartbeat, or were taken out of operation, while enabled."""


class DrivePeer:
    """The other end of `Drives`: one drive a joint, and the robot that they turn."""

    def __init__(
        self,
        config: CanopenConfig,
        skeleton: Skeleton,
        encoders: EncoderConfig,
        send: SendOn,
        origin_ns: int,
        faults: Sequence[PlannedDriveFault] = (),
        *,
        position_rad: Array | None = None,
    ) -> None:
        """`position_rad` (J,): where the joints stand at first; else at 0, or as near as limits let them."""
        self.counters = DriveCounters()
        self._torque = ToldTorque(config, skeleton, origin_ns)
        self.plant = Plant(skeleton, encoders, origin_ns, position_rad, each_cycle=self._torque.take)
        self._names = skeleton.joint_names
        self._first_sync_ns: int | None = None
        self._looked_ns = 0
        self._planned = sorted(faults, key=lambda fault: fault.after_s)
        drives = list(config.drives_of(skeleton).values())
        self._scale = np.array([drive.increments_per_rad for drive in drives])
        self._zero = np.array([drive.zero_increments for drive in drives], dtype=np.float64)
        self._over = np.array([drive.counts_over for drive in drives])
        self._lower, self._upper = np.full(len(drives), -np.inf), np.full(len(drives), np.inf)
        self._period_ns = NS_PER_S // config.sync_hz
        self._gear, self._shift = np.ones(len(drives)), np.zeros(len(drives))
        """What a drive is wrong by: true scale over the configured one, and increments."""
        self._stuck: dict[int, int] = {}
        self._read()
        senders = [_sender(send, drive.bus) for drive in drives]
        self.drives = [
            SimulatedDrive(drive.id, sender, serial)
            for serial, (drive, sender) in enumerate(zip(drives, senders, strict=True), 1)
        ]
        self._senders = senders
        self._twins: dict[int, SimulatedDrive] = {}
        """Drives without a joint that have the id of a joint's."""
        self._on_bus: dict[str, list[int]] = {bus.name: [] for bus in config.buses}
        self._by_id: dict[tuple[str, int], list[int]] = {}
        for simulated, rated_mnm in zip(self.drives, self._torque.rated_mnm.tolist(), strict=True):
            simulated.rated_torque_mnm = rated_mnm
        for i, drive in enumerate(drives):
            self._on_bus[drive.bus].append(i)
            for code in (*pdo.RPDOS, pdo.SDO_REQUEST):
                self._by_id.setdefault((drive.bus, code + drive.id), []).append(i)
        self._states = [drive.state for drive in self.drives]
        self._show()

    def on_frame(self, bus: str, frame_id: int, data: bytes, now_ns: int) -> None:
        """Handle one frame from the slave, or from another sender."""
        addressed = self._by_id.get((bus, frame_id))
        if addressed is not None:
            for i in addressed:
                self._pass_frame(i, frame_id, data, now_ns)
                if frame_id & 0x780 == pdo.SDO_REQUEST:
                    self._take_in_settings(i)
            if frame_id & 0x780 in pdo.RPDOS:
                return  # it waits for SYNC
        elif frame_id == pdo.SYNC:
            self._on_sync(bus, now_ns)
        elif frame_id == pdo.NMT or frame_id & 0x780 == pdo.HEARTBEAT:
            for i in self._on_bus.get(bus, ()):
                self._pass_frame(i, frame_id, data, now_ns)
        self._follow_states()

    def build(self, joint: str, maker: Maker) -> None:
        """Let another maker have built a joint's drive."""
        drive = self.drives[self._names.index(joint)]
        drive.become(maker(drive.id))

    def on_remote(self, bus: str, frame_id: int, now_ns: int) -> None:
        """Handle one remote request."""
        for i in self._on_bus.get(bus, ()):
            self.drives[i].on_remote(frame_id, now_ns)

    def _pass_frame(self, i: int, frame_id: int, data: bytes, now_ns: int) -> None:
        self.drives[i].on_frame(frame_id, data, now_ns)
        if i in self._twins:
            self._twins[i].on_frame(frame_id, data, now_ns)

    def advance(self, now_ns: int) -> None:
        """Physics, heartbeats, following errors, and faults that are due. Call every few milliseconds."""
        self.plant.advance(now_ns)
        if now_ns - self._looked_ns < _LOOK_NS:
            return
        self._looked_ns = now_ns
        self._show()
        if self._first_sync_ns is not None:
            while self._planned and now_ns - self._first_sync_ns >= self._planned[0].after_s * NS_PER_S:
                due = self._planned.pop(0)
                self.happen(due.joint, due.fault)
        late = self.plant.beyond_ns
        moving = self.plant.moving
        for twin in self._twins.values():
            twin.beat(now_ns)
        for i, drive in enumerate(self.drives):
            drive.beat(now_ns)
            if late[i] and drive.state is Power.ENABLED and late[i] >= _patience_ns(drive):
                drive.fail(*_FOLLOWING_ERROR)
            if not moving[i]:
                drive.at_rest()
        self._follow_states()

    def happen(self, joint: str, fault: DriveFault) -> None:
        """Make a drive fail, or well again."""
        log.info("%s: %s", joint, fault.option)
        self.counters.faults += 1
        self._drive(self._names.index(joint), fault)
        self._follow_states()

    def _drive(self, i: int, fault: DriveFault) -> None:
        """A fault of the mechanics, which the drive itself does not know of; or of the drive."""
        drive, scale = self.drives[i], self._scale[i]
        true = self._zero[i] + scale * self.plant.position_rad[i]
        self._gear[i], self._shift[i] = 1.0, 0.0
        self._twins.pop(i, None)
        self._stuck.pop(i, None)
        match fault:
            case DriveFault.LOST_TURNS:
                self._shift[i] = -true
            case DriveFault.WRONG_ZERO:
                self._shift[i] = _WRONG_ZERO_RAD * scale
            case DriveFault.WRONG_GEAR:
                self._gear[i] = 2.0
            case DriveFault.REVERSED:
                self._gear[i] = -1.0
            case DriveFault.POSITION_STUCK:
                self._stuck[i] = drive.position
            case DriveFault.DOUBLE_ID:
                twin = SimulatedDrive(drive.id, self._senders[i], serial=1000 + i)
                twin.position = round(true + _TWIN_RAD * scale)
                self._twins[i] = twin
        drive.happen(fault)
        self._show()
        if drive.state is Power.ENABLED:
            # it goes on from where it is, in whichever frame it believes itself to be
            drive.target = self._increments[i]

    def _on_sync(self, bus: str, now_ns: int) -> None:
        self.counters.syncs += 1
        if self._first_sync_ns is None:
            self._first_sync_ns = now_ns
        self.plant.advance(now_ns)
        self._torque.latch(now_ns)
        self._show(now_ns)
        for i in self._on_bus.get(bus, ()):
            drive = self.drives[i]
            drive.on_sync()
            self._torque.limit(i, drive.torque_limits)
            if i in self._twins:
                self._twins[i].on_sync()
            if drive.follows:
                self._follow(i, drive, now_ns)
        self.plant.limit_torque(self._torque.limit_nm)

    def _follow(self, i: int, drive: SimulatedDrive, now_ns: int) -> None:
        if drive.fault is DriveFault.RUNS_AWAY:
            step = _RUNS_AWAY_RAD_S * self._period_ns / NS_PER_S
            self.plant.follow(i, float(self.plant.position_rad[i]) + 2.0 * step, 2 * self._period_ns, now_ns)
            return
        target = float(drive.target)
        if self._over[i]:  # by the shorter way from where it stands
            target = float(nearest_to(self._unbounded[i], np.array(target)))
        believed = (target - self._zero[i]) / self._scale[i]
        allowed = min(max(believed, self._lower[i]), self._upper[i])
        drive.limited = abs(believed - allowed) > 1e-6
        true = (self._zero[i] + self._scale[i] * allowed - self._shift[i] - self._zero[i]) / self._scale[i]
        self.plant.follow(i, true / self._gear[i], self._period_ns, now_ns)

    def _follow_states(self) -> None:
        for i, drive in enumerate(self.drives):
            was, self._states[i] = self._states[i], drive.state
            if was is drive.state:
                continue
            if drive.state is not Power.ENABLED:
                self.plant.brake(i)
            if was is Power.ENABLED:
                self.counters.stopped_by_themselves += 1
                log.info("%s: %s", self._names[i], drive.state)

    def _take_in_settings(self, i: int) -> None:
        """What the plant needs to know of the dictionary, in the joint's own units."""
        drive = self.drives[i]
        scale = abs(self._scale[i])
        lacks = drive.traits.lacks
        window = _UNBOUNDED if 0x6065 in lacks else drive.value(0x6065)
        self.plant.window_rad[i] = np.inf if window == _UNBOUNDED else window / scale
        if ramp := 0 if 0x6085 in lacks else drive.value(0x6085):
            self.plant.ramp_rad_s2[i] = ramp / scale
        if 0x607D in lacks or self._over[i]:
            return
        ends = [(drive.value(0x607D, sub) - self._zero[i]) / self._scale[i] for sub in (1, 2)]
        self._lower[i], self._upper[i] = min(ends), max(ends)

    def _read(self, now_ns: int | None = None) -> None:
        seen_rad = self.plant.position_rad if now_ns is None else self.plant.seen_rad(now_ns)
        position = seen_rad * self._gear
        shown = self._unbounded = np.rint(self._zero + self._scale * position + self._shift)
        shown = np.where(self._over, counted_over(shown), shown)
        self._increments = shown.astype(np.int64).tolist()
        for i, increments in self._stuck.items():
            self._increments[i] = increments
        self._counts = self.plant.counts(seen_rad).tolist()

    def _show(self, now_ns: int | None = None) -> None:
        self._read(now_ns)
        told = self._torque.thousandths.tolist()
        for drive, position, count, torque in zip(
            self.drives, self._increments, self._counts, told, strict=True
        ):
            drive.position, drive.count = position, count
            if drive.fault is not DriveFault.TORQUE_STUCK:
                drive.thousandths = -torque if drive.tells_against_position else torque


def _sender(send: SendOn, bus: str) -> Callable[[int, bytes], None]:
    return lambda frame_id, data: send(bus, frame_id, data)


def _patience_ns(drive: SimulatedDrive) -> int:
    """For how long a drive may be beyond its window of following error."""
    return 0 if 0x6066 in drive.traits.lacks else drive.value(0x6066) * NS_PER_MS
