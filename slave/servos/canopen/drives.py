"""All drives as one: frames in, frames out, SYNC by SYNC. Pure; the clock is handed in.

configure (SDO) ▸ operational (NMT) ▸ enable (402) ▸ run: each SYNC takes in targets and answers positions
                                                      └▸ failed, latched, until `start` or `release`
"""

from __future__ import annotations

import operator
from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType

import numpy as np

from common.clock import NS_PER_MS
from common.quaternion import Array
from common.skeleton import Skeleton
from slave.encoders.counts import EncoderConfig, Encoders
from slave.servos.canopen import pdo
from slave.servos.canopen.answers import SyncAnswers
from slave.servos.canopen.config import CanopenConfig
from slave.servos.canopen.drive import DriveState, Phase
from slave.servos.canopen.effort import DriveEfforts
from slave.servos.canopen.emergency import emergency
from slave.servos.canopen.second_master import SecondMaster
from slave.servos.canopen.setup import transfers
from slave.servos.canopen.signs import DriveSigns
from slave.servos.canopen.silence import DriveSilence
from slave.servos.canopen.status_bits import VOLTAGE
from slave.servos.canopen.supervision import LISTENED, Supervision
from slave.servos.canopen.targets import DriveTargets
from slave.servos.canopen.units import DriveUnits
from slave.servos.canopen.watch import DriveWatch
from slave.servos.canopen.wiring import (
    BOOTED,
    OPERATIONAL,
    PRE_OPERATIONAL,
    START,
    STOP,
    DriveWiring,
    Outgoing,
)
from slave.servos.servos import EncoderReading


class Drives:
    """All drives of one robot, in the order of its joints."""

    def __init__(
        self,
        config: CanopenConfig,
        skeleton: Skeleton,
        encoders: EncoderConfig | None = None,
        *,
        last_known_rad: Mapping[str, float] = MappingProxyType({}),
    ) -> None:
        """`encoders`: how they are mounted at the output shafts; `last_known_rad`: where joints stood."""
        self._config = config
        self._wiring = DriveWiring(config, skeleton)
        self._units = DriveUnits.of(config, skeleton)
        every = config.effort_syncs(skeleton)
        self._drives = [
            DriveState(transfers(config, drive, joint, every), sto_codes=config.sto_codes)
            for drive, joint in zip(config.drives_of(skeleton).values(), skeleton.joints, strict=True)
        ]
        count = len(self._drives)
        nodes = {bus.name: self._wiring.on_bus(bus.name) for bus in config.buses}
        self.second_master = SecondMaster(nodes, config.node_id)
        self._watch = DriveWatch(
            self._wiring.joints,
            self._units,
            Encoders(skeleton, encoders),
            period_ns=config.period_ns,
            pending_ns=config.dead_ms * NS_PER_MS,
            last_known_rad=last_known_rad,
        )
        self._silence = DriveSilence(config, count)
        self._targets = DriveTargets(config, self._units)
        self._answers = SyncAnswers(count)
        self.efforts = DriveEfforts(config, skeleton)
        self._effort_is_newer = False
        self._beat_every = max(1, config.heartbeat_ms * config.sync_hz // 1000)
        self._supervision = Supervision(self._drives, self._watch, self._silence)
        self._inputs = dict.fromkeys(config.tell_inputs, (0, 0))
        """When each drive's digital inputs came last, and what they were."""
        self._encoder_flags = np.zeros(count, np.uint16)
        self._down: dict[str, str] = {}
        """Why each bus that has failed did, by name."""
        self._commands = False
        """Whether it has ever sent a drive anything: before, another master may be the rightful one."""
        self._cycles = self._synced_ns = 0
        self._fault_words: dict[str, str] = {}
        self._reading = EncoderReading(0, np.zeros(count, np.int64), np.zeros(count, np.bool_))
        self.faults: Mapping[str, str] = MappingProxyType({})
        """The faults as text, by joint. Replaced, never changed."""
        self.outbox: list[Outgoing] = []
        """What must be sent at once: the adapter empties it."""
        self.answered_after_ns: int | None = None
        """From the last SYNC to the last drive's answer; None until all have answered."""
        self.unanswered = 0
        """SYNCs that not every drive answered before the next."""
        self.unknown = 0
        """Frames that no drive of this robot sends."""

    # in

    def start(self, now_ns: int) -> None:
        """Configure every drive afresh, then enable it; not while a second master speaks."""
        self._begin(now_ns, configure=True)

    def release(self, now_ns: int) -> None:
        """After a stop: enable every drive again, those that had failed too; not with a second master."""
        self._begin(now_ns, configure=False)

    def _begin(self, now_ns: int, configure: bool) -> None:
        if self.second_master.speaks(now_ns):
            return
        self.second_master.forget()
        self._supervision.stopping = False
        self._commands = self._commands or configure
        for i in range(len(self._drives)):
            self._start(i, now_ns, configure)
        self._update_faults()

    def stop(self) -> None:
        """From the next cycle on every drive brakes and stays."""
        self._supervision.stopping = True
        self._supervision.settled = False

    def on_bus(self, bus: str, down: str) -> None:
        """A bus has failed, for the reason `down`, or works again: an empty reason."""
        if down:
            self._down[bus] = down
        else:
            self._down.pop(bus, None)
        self._update_faults()

    def on_frame(self, bus: str, frame_id: int, data: bytes, now_ns: int) -> None:
        """One frame that this side did not send: of a drive, or of a second master."""
        drive = self._wiring.answering(bus, frame_id)
        if drive is None:
            self._on_other(bus, frame_id, data, now_ns)
        elif self._answers.take(drive, data):
            twice = self._watch.answered(drive)
            if twice and self._drives[drive].phase in LISTENED:
                self._supervision.fail(drive, twice)
                self._update_faults()
            if self._answers.complete:
                if self.answered_after_ns is None:
                    self.answered_after_ns = now_ns - self._synced_ns
                if self.efforts.complete:
                    self._publish()
        else:
            self.unknown += 1

    def _on_other(self, bus: str, frame_id: int, data: bytes, now_ns: int) -> None:
        if self.second_master.hear(bus, frame_id, now_ns):
            self._on_second_master()
            return
        i = self._wiring.sending(bus, frame_id)
        if i is None:
            self.unknown += 1
            return
        drive = self._drives[i]
        match frame_id & 0x780:
            case pdo.SDO_ANSWER:
                following = drive.on_sdo(data, now_ns)
                if following is not None:
                    self.outbox.append(self._wiring.sdo(i, following))
                elif drive.phase is Phase.CHECKING:
                    self._operate(i, now_ns)
                else:
                    self._update_faults()
            case pdo.HEARTBEAT if len(data) == 1:
                self._silence.heartbeat(i, now_ns)
                self._on_state(i, data[0] & 0x7F, now_ns)
            case pdo.TPDO2 if self.efforts.take(i, data):
                self._effort_is_newer = True
                # by CAN's priorities efforts come after the positions, and belong to the same reading
                if self._answers.complete and self.efforts.complete:
                    self._publish()
            case pdo.EMERGENCY:
                message = emergency(data)
                if message is not None:
                    drive.on_emergency(message, now_ns)
                    self._update_faults()
            case pdo.TPDO3 if self._wiring.joints[i] in self._inputs and len(data) == pdo.INPUTS_BYTES:
                self._inputs[self._wiring.joints[i]] = now_ns, int.from_bytes(data, "little")
            case _:
                self.unknown += 1

    def _on_second_master(self) -> None:
        """Stop all drives, by what two masters' controlwords cannot take turns at: NMT."""
        if any(drive.phase is not Phase.FAILED for drive in self._drives):
            for i, drive in enumerate(self._drives):
                drive.fail("stopped", reconfigure=True)
                self.outbox.append(self._wiring.nmt(i, STOP))
        self._update_faults()

    def _on_state(self, i: int, state: int, now_ns: int) -> None:
        drive = self._drives[i]
        if self._commands and self.second_master.buses and state == OPERATIONAL:
            self.outbox.append(self._wiring.nmt(i, STOP))  # the other has started it again
            return
        if drive.phase is Phase.CONFIGURING and state == BOOTED:
            if not drive.on_boot(now_ns):
                self._update_faults()
                return
            # what it was told before is forgotten, the slave's heartbeat that it shall watch for among it
            self._start(i, now_ns, configure=True)
            return
        # while it is enabled, a heartbeat from before NMT's start may still be on its way
        left = drive.phase is Phase.RUNNING and state != OPERATIONAL
        if left or (drive.phase in (Phase.CHECKING, Phase.ENABLING) and state == BOOTED):
            drive.fail("has restarted" if state == BOOTED else "is not operational", reconfigure=True)
            self._update_faults()

    # out

    def pending(self, now_ns: int) -> None:
        """Repeat SDO requests whose answers are overdue, into the outbox."""
        for i, drive in enumerate(self._drives):
            again = drive.overdue(now_ns)
            if again is not None:
                self.outbox.append(self._wiring.sdo(i, again))

    def cycle(self, now_ns: int, setpoint_rad: Array | None) -> list[Outgoing]:
        """The frames before a SYNC: heartbeats, and every drive's controlword and target (RPDOs)."""
        if not self._answers.complete:
            self.unanswered += self._cycles > 0
        if not self._answers.complete or not self.efforts.complete:
            self._publish()
        seen = self._answers.of(self._synced_ns)
        self._silence.cycle(now_ns, seen.fresh, self._synced_ns)
        self.pending(now_ns)
        supervision = self._supervision
        supervision.look(now_ns, seen)
        controlwords = supervision.controlwords(now_ns, seen)
        if not supervision.settled:
            self._update_faults()
            supervision.settled = self.running and not self._fault_words
        targets = self._targets.step(setpoint_rad, seen.position, supervision.running)
        self._watch.aim(self._targets.target_rad, supervision.running)
        out = self._wiring.heartbeats() if self._cycles % self._beat_every == 0 else []
        self._cycles += 1
        if self.second_master.buses:
            # its controlwords and these would lead each drive to and fro, SYNC by SYNC: NMT has stopped them
            return out
        data = pdo.pack_targets(controlwords, targets)
        return out + self._wiring.targets(data, self._silence.seen(now_ns))

    def sync(self, now_ns: int) -> list[Outgoing]:
        """The SYNCs, to be sent right now."""
        self._answers.begin()
        self.efforts.asked()
        self._watch.asked()
        self._synced_ns = now_ns
        self.answered_after_ns = None
        return self._wiring.syncs()

    @property
    def reading(self) -> EncoderReading:
        """The newest; efforts that are told more seldom than positions join it when they come."""
        if self._effort_is_newer and self.efforts.complete:
            self._effort_is_newer = False
            self._reading = replace(self._reading, effort_nm=self.efforts.joint_nm)
        return self._reading

    @property
    def warnings(self) -> Mapping[str, str]:
        """What drives warn of, by joint: no reason to stop yet."""
        return self._supervision.warnings

    @property
    def running(self) -> bool:
        """Whether every drive is enabled."""
        return bool(self._supervision.running.all())

    @property
    def failed(self) -> bool:
        """Whether any drive has failed for good, otherwise than by lacking torque."""
        return any(drive.phase is Phase.FAILED and not drive.torqueless for drive in self._drives)

    @property
    def waiting_for_torque(self) -> bool:
        """Whether every drive runs, or would with torque; and at least one lacks it."""
        drives = self._drives
        lacking = [drive.torqueless for drive in drives]
        return any(lacking) and all(map(operator.or_, lacking, [d.phase is Phase.RUNNING for d in drives]))

    def signs(self, joint: str) -> DriveSigns:
        """What the drive of a joint tells of its torque and its digital inputs."""
        i = self._wiring.joints.index(joint)
        drive, statusword = self._drives[i], self._answers.statusword(i)
        return DriveSigns(
            self._silence.known_ns(i), bool(statusword & VOLTAGE), drive.torque_off_ns, drive.torque_off,
            *self._inputs.get(joint, (0, 0)),
        )  # fmt: skip

    @property
    def not_running(self) -> dict[str, str]:
        """Drives that do not run, with node, bus and reason, by joint: those that have failed first."""
        rows = zip(self._wiring.joints, self._wiring.where, self._drives, strict=True)
        waiting = sorted(
            (row for row in rows if row[2].phase is not Phase.RUNNING),
            key=lambda row: row[2].phase is not Phase.FAILED,
        )
        return {name: f"node {node} on bus {bus} {drive.words}" for name, (bus, node), drive in waiting}

    # within

    def _start(self, i: int, now_ns: int, configure: bool) -> None:
        drive = self._drives[i]
        self._supervision.restart(i)
        first = drive.start(now_ns, self._config.fault_reset, configure)
        if first is not None:
            self.outbox.append(self._wiring.nmt(i, PRE_OPERATIONAL))
            self.outbox.append(self._wiring.sdo(i, first))
        else:
            self._silence.begin(i, now_ns)

    def _operate(self, i: int, now_ns: int) -> None:
        self._silence.begin(i, now_ns)
        self.efforts.configured(i, self._drives[i].held, self._drives[i].lacks)
        self._watch.connect(i)
        self.outbox.append(self._wiring.nmt(i, START))

    def _publish(self) -> None:
        self._effort_is_newer = False
        seen = self._answers.of(self._synced_ns)
        drive_rad = self._units.angle_rad(seen.position)
        self._reading = EncoderReading(
            self._synced_ns, seen.encoder_counts, seen.encoder_valid, drive_rad, self.efforts.joint_nm
        )
        if (seen.encoder_flags != self._encoder_flags).any():
            self._encoder_flags = seen.encoder_flags
            for drive, flag in zip(self._drives, seen.encoder_flags.tolist(), strict=True):
                drive.encoder = pdo.encoder_words(flag)
            self._update_faults()

    def _update_faults(self) -> None:
        """Put together what is wrong with each drive: a second master, its bus, the drive itself."""
        words = {}
        other = self.second_master.words
        for name, (bus, _), drive in zip(self._wiring.joints, self._wiring.where, self._drives, strict=True):
            down = f"bus {bus} is down: {self._down[bus]}" if bus in self._down else ""
            if wrong := "; ".join(filter(None, [down, other, drive.words])):
                words[name] = wrong
        if words != self._fault_words:
            self._fault_words = words
            self._supervision.settled = False
            self.faults = MappingProxyType(words)
