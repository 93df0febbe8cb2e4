"""All drives as one: frames in, frames out, SYNC by SYNC. Pure; the clock is handed in.

configure (SDO) ▸ operational (NMT) ▸ enable (402) ▸ run: each SYNC takes in targets and answers positions
  starts.py                            supervision.py   └▸ failed, latched, until `start` or `release`
"""

from __future__ import annotations

import operator
from collections.abc import Mapping, Sequence
from types import MappingProxyType

from common.clock import NS_PER_MS
from common.quaternion import Array
from common.skeleton import Skeleton
from slave.encoders.counts import EncoderConfig, Encoders
from slave.servos.canopen import pdo
from slave.servos.canopen.config import CanopenConfig
from slave.servos.canopen.drive import DriveState, Phase
from slave.servos.canopen.eds_check import eds_of
from slave.servos.canopen.emergency import emergency
from slave.servos.canopen.fault_words import FaultWords
from slave.servos.canopen.readings import DriveReadings
from slave.servos.canopen.second_master import SecondMaster
from slave.servos.canopen.setup import SetupPlan
from slave.servos.canopen.setup_run import SetupRun
from slave.servos.canopen.silence import DriveSilence
from slave.servos.canopen.starts import DriveStarts
from slave.servos.canopen.status_bits import VOLTAGE
from slave.servos.canopen.supervision import LISTENED, Supervision
from slave.servos.canopen.sync_stamp import SyncStamps
from slave.servos.canopen.targets import DriveTargets
from slave.servos.canopen.torque_limits import DriveTorqueLimits
from slave.servos.canopen.units import DriveUnits
from slave.servos.canopen.watch import DriveWatch
from slave.servos.canopen.wiring import DriveWiring, Outgoing
from slave.servos.servos import EncoderReading
from slave.servos.signs import DriveSigns


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
        self._wiring = DriveWiring(config, skeleton)
        units, shown = DriveUnits.of(config, skeleton), Encoders(skeleton, encoders)
        self._drives = [
            DriveState(
                SetupRun(SetupPlan(settings, None if settings.eds is None else eds_of(settings.eds))),
                sto_codes=config.sto_codes,
                boots_twice=settings.drive.boots_twice,
            )
            for settings in config.settings(skeleton)
        ]
        nodes = {bus.name: self._wiring.on_bus(bus.name) for bus in config.buses}
        self.second_master = SecondMaster(nodes, config.node_id)
        self._readings = DriveReadings(config, skeleton, units, shown, on_flags=self._on_flags)
        self._watch = DriveWatch(
            self._wiring.joints,
            units,
            shown,
            period_ns=config.period_ns,
            pending_ns=config.dead_ms * NS_PER_MS,
            last_known_rad=last_known_rad,
            single=self._readings.single,
        )
        self._silence = DriveSilence(config, len(self._drives))
        self._targets = DriveTargets(config, units)
        self._limits = DriveTorqueLimits(config, skeleton)
        self._stamps = SyncStamps(config.period_ns, round(config.sample_error_ms * NS_PER_MS))
        self._beat_every = max(1, config.heartbeat_ms * config.sync_hz // 1000)
        self._supervision = Supervision(self._drives, self._watch, self._silence)
        self._starts = DriveStarts(
            self._drives, self._wiring, self._supervision, silence=self._silence, watch=self._watch,
            readings=self._readings, limits=self._limits, second_master=self.second_master,
            may_reset=config.fault_reset,
        )  # fmt: skip
        self._words = FaultWords(self._drives, self._wiring)
        self._inputs = dict.fromkeys(config.tell_inputs, (0, 0))
        """When each drive's digital inputs came last, and what they were."""
        self._cycles = self._synced_ns = 0
        self.answered_after_ns: int | None = None
        """From the last SYNC to the last drive's answer; None until all have answered."""
        self.unanswered = 0
        """SYNCs that not every drive answered before the next."""
        self.unknown = 0
        """Frames that no drive of this robot sends."""

    # in

    def start(self, now_ns: int) -> None:
        """Configure every drive afresh, then enable it; not while a second master speaks."""
        if self._starts.begin(now_ns, configure=True):
            self._update_faults()

    def release(self, now_ns: int) -> None:
        """After a stop: enable every drive again, those that had failed too; not with a second master."""
        if self._starts.begin(now_ns, configure=False):
            self._update_faults()

    def stop(self) -> None:
        """From the next cycle on every drive brakes and stays."""
        self._supervision.stopping = True
        self._supervision.settled = False

    def on_bus(self, bus: str, down: str) -> None:
        """A bus has failed, for the reason `down`, or works again: an empty reason."""
        self._words.on_bus(bus, down)
        self._update_faults()

    def on_frame(self, bus: str, frame_id: int, data: bytes, now_ns: int) -> None:
        """One frame that this side did not send: of a drive, or of a second master."""
        drive = self._wiring.answering(bus, frame_id)
        if drive is None:
            self._on_other(bus, frame_id, data, now_ns)
            return
        own = self._wiring.pdos[drive]
        answer = own.answer(data)
        if answer is None or not self._readings.answers.take(drive, answer):
            self.unknown += 1
            return
        for told in (own.effort, own.inputs):
            if told is not None and told.frame_id == frame_id:
                self._on_told(drive, own.effort is told, told.of(data), now_ns)
        twice = self._watch.answered(drive)
        if twice and self._drives[drive].phase in LISTENED:
            self._supervision.fail(drive, twice)
            self._update_faults()
        if self._readings.answers.complete:
            if self.answered_after_ns is None:
                self.answered_after_ns = now_ns - self._synced_ns
            self._publish_if_complete()

    def _on_other(self, bus: str, frame_id: int, data: bytes, now_ns: int) -> None:
        if self.second_master.hear(bus, frame_id, now_ns):
            self._starts.stop_by_nmt()
            self._update_faults()
            return
        i = self._wiring.sending(bus, frame_id)
        if i is None:
            self.unknown += 1
            return
        own = self._wiring.pdos[i]
        match frame_id & 0x780:
            case pdo.SDO_ANSWER:
                if self._starts.on_sdo(i, data, now_ns):
                    self._update_faults()
            case pdo.HEARTBEAT if len(data) == 1:
                self._silence.heartbeat(i, now_ns)
                # bit 7 toggles from answer to answer of node guarding
                if self._starts.on_state(i, data[0] & 0x7F, now_ns):
                    self._update_faults()
            case pdo.EMERGENCY:
                message = emergency(data)
                if message is not None:
                    self._drives[i].on_emergency(message, now_ns)
                    self._update_faults()
            case _:
                both = (own.effort, own.inputs)
                told = next((one for one in both if one and one.frame_id == frame_id), None)
                if told is None or not self._on_told(i, told is own.effort, told.of(data), now_ns):
                    self.unknown += 1

    def _on_told(self, i: int, effort: bool, data: bytes, now_ns: int) -> bool:
        """A drive's effort, or its inputs. False where they are not wanted, or not of the right length."""
        if effort:
            if not self._readings.take_effort(i, data):
                return False
            # by CAN's priorities efforts come after the positions, and belong to the same reading
            self._publish_if_complete()
            return True
        name = self._wiring.joints[i]
        if name not in self._inputs or len(data) != pdo.INPUTS_BYTES:
            return False
        self._inputs[name] = now_ns, int.from_bytes(data, "little")
        return True

    # out

    @property
    def outbox(self) -> list[Outgoing]:
        """What must be sent at once: the adapter empties it."""
        return self._starts.outbox

    @outbox.setter
    def outbox(self, frames: list[Outgoing]) -> None:
        self._starts.outbox = frames

    def pending(self, now_ns: int) -> None:
        """Repeat SDO requests whose answers are overdue, into the outbox."""
        self._starts.pending(now_ns)

    def cycle(
        self, now_ns: int, setpoint_rad: Array | None, torque_nm: Array | None = None
    ) -> list[Outgoing]:
        """The frames before a SYNC: heartbeats, and every drive's controlword, target and torque limit.

        `torque_nm`: (2, J) the least and greatest torque at each joint; None: as much as the drives have.
        """
        if not self._readings.answers.complete:
            self.unanswered += self._cycles > 0
        if not self._readings.complete:
            self._readings.publish(self._synced_ns, self._stamps.error_ns)
        seen = self._readings.seen(self._synced_ns)
        self._silence.cycle(now_ns, seen.fresh, self._synced_ns)
        self.pending(now_ns)
        supervision = self._supervision
        supervision.look(now_ns, seen)
        controlwords = supervision.controlwords(now_ns, seen)
        if not supervision.settled:
            self._update_faults()
            supervision.settled = self.running and not self._words.by_joint
        targets = self._targets.step(setpoint_rad, seen.position, supervision.running)
        self._watch.aim(self._targets.target_rad, supervision.running)
        out = self._wiring.heartbeats() if self._cycles % self._beat_every == 0 else []
        self._cycles += 1
        if self.second_master.buses:
            # its controlwords and these would lead each drive to and fro, SYNC by SYNC: NMT has stopped them
            return out
        data = pdo.pack_targets(controlwords, targets)
        sent = self._silence.seen(now_ns)
        limits = self._limits.data(None if supervision.stopping else torque_nm)
        return out + self._wiring.targets(data, sent) + self._wiring.limits(limits, sent)

    def sync(self, now_ns: int) -> list[Outgoing]:
        """The SYNCs, to be sent right now."""
        self._readings.answers.begin()
        self._readings.efforts.asked()
        self._watch.asked()
        self._synced_ns, self.answered_after_ns = now_ns, None
        return self._wiring.syncs()

    def synced(self, now_ns: int) -> None:
        """They have been sent."""
        self._stamps.sent(self._synced_ns, now_ns)

    # what is known

    @property
    def reading(self) -> EncoderReading:
        """The newest."""
        return self._readings.newest

    @property
    def faults(self) -> Mapping[str, str]:
        """The faults as text, by joint. Replaced, never changed."""
        return self._words.by_joint

    @property
    def no_effort(self) -> dict[str, str]:
        """Why the effort of a joint is not known, by joint."""
        return self._readings.efforts.missing

    @property
    def no_torque_limit(self) -> dict[str, str]:
        """Why a joint's drive takes no torque limit, by joint."""
        return self._limits.missing

    @property
    def left_out(self) -> dict[str, str]:
        """What drives lack that they may lack, by joint."""
        return self._words.left_out

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

    @property
    def not_running(self) -> dict[str, str]:
        """Drives that do not run, with node, bus and reason, by joint: those that have failed first."""
        return self._words.not_running

    def signs(self, joint: str) -> DriveSigns:
        """What the drive of a joint tells of its torque and its digital inputs."""
        i = self._wiring.joints.index(joint)
        drive, statusword = self._drives[i], self._readings.answers.statusword(i)
        return DriveSigns(
            self._silence.known_ns(i), bool(statusword & VOLTAGE), drive.torque_off_ns, drive.torque_off,
            *self._inputs.get(joint, (0, 0)),
        )  # fmt: skip

    # within

    def _publish_if_complete(self) -> None:
        if self._readings.complete:
            self._readings.publish(self._synced_ns, self._stamps.error_ns)

    def _on_flags(self, words: Sequence[str]) -> None:
        for drive, said in zip(self._drives, words, strict=True):
            drive.encoder = said
        self._update_faults()

    def _update_faults(self) -> None:
        if self._words.update(self.second_master.words):
            self._supervision.settled = False
