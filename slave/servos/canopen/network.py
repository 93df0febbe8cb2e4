"""All drives as one: frames in, frames out, SYNC by SYNC. Pure; the clock is handed in.

configure (SDO) ▸ operational (NMT) ▸ enable (402) ▸ run: each SYNC takes in targets and answers positions
                                                      └▸ failed, latched, until `start` or `release`
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from common.clock import NS_PER_MS, NS_PER_S
from common.quaternion import Array
from common.skeleton import Skeleton
from common.wire.messages import Mask
from slave.encoders.counts import EncoderConfig, Encoders
from slave.servos.canopen import pdo
from slave.servos.canopen.cia402 import ENABLED_BITS, SHUTDOWN, STATE_BITS
from slave.servos.canopen.config import CanopenConfig, limits_rad
from slave.servos.canopen.drive import Drive, Phase
from slave.servos.canopen.emergency import HEARTBEAT_MISSED, emergency
from slave.servos.canopen.second_master import SecondMaster
from slave.servos.canopen.setup import transfers
from slave.servos.canopen.watch import DriveWatch, Seen
from slave.servos.canopen.watch import Frame as DriveFrame
from slave.servos.servos import EncoderReading

Outgoing = tuple[str, int, bytes]
"""Bus name, identifier, data."""
_START, _STOP, _PRE_OPERATIONAL = 0x01, 0x02, 0x80
"""NMT commands."""
_BOOTED, _OPERATIONAL = 0x00, 0x05
"""NMT states in a heartbeat."""
_LISTENED = (Phase.CHECKING, Phase.ENABLING, Phase.RUNNING)
_FLAGS = np.uint16(pdo.MAGNET_LOST | pdo.PARITY_ERROR)


class DriveNetwork:
    """The drives of one robot, in the order of its joints."""

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
        self._names = skeleton.joint_names
        drives = list(config.drives_of(skeleton).values())
        count = len(drives)
        self._where = [(drive.bus, drive.id) for drive in drives]
        self._by_tpdo = {(bus, pdo.TPDO1 + n): i for i, (bus, n) in enumerate(self._where)}
        self._by_node = {where: i for i, where in enumerate(self._where)}
        nodes: dict[str, dict[int, str]] = {bus.name: {} for bus in config.buses}
        for joint, (bus_name, node_id) in zip(self._names, self._where, strict=True):
            nodes.setdefault(bus_name, {})[node_id] = joint
        self.second_master = SecondMaster(nodes, config.node_id)
        self._rpdo = [(bus, pdo.RPDO1 + n) for bus, n in self._where]
        self._drives = [
            Drive(transfers(config, drive, joint))
            for drive, joint in zip(drives, skeleton.joints, strict=True)
        ]
        self._scale = np.array([drive.increments_per_rad for drive in drives])
        self._zero = np.array([drive.zero_increments for drive in drives], dtype=np.float64)
        self._watch = DriveWatch(
            self._names,
            DriveFrame(
                self._scale,
                self._zero,
                tuple(
                    limits_rad(drive, joint.lower_rad, joint.upper_rad)
                    for drive, joint in zip(drives, skeleton.joints, strict=True)
                ),
            ),
            Encoders(skeleton, encoders),
            period_ns=period_ns(config),
            pending_ns=config.dead_ms * NS_PER_MS,
            last_known_rad=last_known_rad,
        )
        self.warnings: Mapping[str, str] = MappingProxyType({})
        """What drives warn of, by joint: no reason to stop yet."""
        self._step_rad = math.radians(config.join_deg_s) / config.sync_hz
        self._dead_ns = config.drive_dead_ms * NS_PER_MS
        self._blind_ns = config.dead_ms * NS_PER_MS // 2
        self._beat_every = max(1, config.heartbeat_ms * config.sync_hz // 1000)
        self._beat = pdo.HEARTBEAT + config.node_id
        self._answers = pdo.Answers(count)
        self._target_rad = np.zeros(count)
        self._joined = np.zeros(count, np.bool_)
        self._running = np.zeros(count, np.bool_)
        self._flags = np.zeros(count, np.uint16)
        self._words = np.full(count, SHUTDOWN, np.uint16)
        self._answered_ns = np.zeros(count, np.int64)
        self._known_ns = np.full(count, -(1 << 62), np.int64)
        """(J,) the SYNC at which each last told its state."""
        self._heard_ns = [0] * count
        self._down: dict[str, str] = {}
        self._stopping = False
        self._commands = False
        """Whether it has ever told a drive anything: before, another master may be the rightful one."""
        self._settled = False
        self._cycles = 0
        self._synced_ns = 0
        self._cycled_ns = 0
        self._told: dict[str, str] = {}
        self.reading = EncoderReading(0, np.zeros(count, np.int64), np.zeros(count, np.bool_))
        self.faults: Mapping[str, str] = MappingProxyType({})
        """By joint, in words. Replaced, never changed."""
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
        if not self._alone(now_ns):
            return
        self._stopping, self._commands = False, True
        for i in range(len(self._drives)):
            self._start(i, now_ns, configure=True)
        self._tell()

    def release(self, now_ns: int) -> None:
        """After a stop: enable every drive again, and those that had failed, too.

        Not while a second master speaks.
        """
        if not self._alone(now_ns):
            return
        self._stopping = False
        for i in range(len(self._drives)):
            self._start(i, now_ns, configure=False)
        self._tell()

    def stop(self) -> None:
        """From the next cycle on every drive brakes and stays."""
        self._stopping = True
        self._settled = False

    def on_bus(self, bus: str, down: str) -> None:
        """A bus has failed, for the reason told, or works (again): an empty reason."""
        if down:
            self._down[bus] = down
        else:
            self._down.pop(bus, None)
        self._tell()

    def on_frame(self, bus: str, frame_id: int, data: bytes, now_ns: int) -> None:
        """One frame that this side did not send: of a drive, or of a second master."""
        drive = self._by_tpdo.get((bus, frame_id))
        if drive is None:
            self._on_other(bus, frame_id, data, now_ns)
        elif self._answers.take(drive, data):
            self._note_answer(drive)
            if self._answers.complete:
                if self.answered_after_ns is None:
                    self.answered_after_ns = now_ns - self._synced_ns
                self._publish()
        else:
            self.unknown += 1

    def _note_answer(self, i: int) -> None:
        twice = self._watch.answered(i)
        if twice and self._drives[i].phase in _LISTENED:
            self._fail(i, twice)

    def _on_other(self, bus: str, frame_id: int, data: bytes, now_ns: int) -> None:
        if self.second_master.hear(bus, frame_id, now_ns):
            self._on_second_master()
            return
        i = self._by_node.get((bus, frame_id & 0x7F))
        if i is None:
            self.unknown += 1
            return
        drive = self._drives[i]
        match frame_id & 0x780:
            case pdo.SDO_ANSWER:
                following = drive.on_sdo(data, now_ns)
                if following is not None:
                    self._ask(i, following)
                elif drive.phase is Phase.CHECKING:
                    self._operate(i, now_ns)
                else:
                    self._tell()
            case pdo.HEARTBEAT if len(data) == 1:
                self._heard_ns[i] = now_ns
                self._on_state(i, data[0] & 0x7F, now_ns)
            case pdo.EMERGENCY:
                said = emergency(data)
                if said is not None:
                    drive.emergency = None if said.over else said
                    if said.code == HEARTBEAT_MISSED and drive.phase is Phase.RUNNING:
                        # told "enable" right after, it would go on as if nothing had been
                        drive.fail("has stopped by itself")
                    self._tell()
            case _:
                self.unknown += 1

    def _alone(self, now_ns: int) -> bool:
        if self.second_master.speaks(now_ns):
            return False
        self.second_master.forget()
        return True

    def _on_second_master(self) -> None:
        """Stop all drives, by what two masters' controlwords cannot take turns at: NMT."""
        if any(drive.phase is not Phase.FAILED for drive in self._drives):
            for i, drive in enumerate(self._drives):
                drive.fail("stopped", reconfigure=True)
                self._nmt(i, _STOP)
        self._tell()

    def _on_state(self, i: int, state: int, now_ns: int) -> None:
        drive = self._drives[i]
        if self._commands and self.second_master.buses and state == _OPERATIONAL:
            self._nmt(i, _STOP)  # the other has started it again
            return
        if drive.phase is Phase.CONFIGURING and state == _BOOTED:
            if not drive.on_boot(now_ns):
                self._tell()
                return
            # what it was told before is forgotten, the slave's heartbeat that it shall watch for among it
            self._start(i, now_ns, configure=True)
            return
        # while it is enabled, a heartbeat from before NMT's start may still be on its way
        left = drive.phase is Phase.RUNNING and state != _OPERATIONAL
        if left or (drive.phase in (Phase.CHECKING, Phase.ENABLING) and state == _BOOTED):
            drive.fail("has restarted" if state == _BOOTED else "is not operational", reconfigure=True)
            self._tell()

    # out

    def pending(self, now_ns: int) -> None:
        """Repeat SDO requests whose answers are overdue, into the outbox."""
        for i, drive in enumerate(self._drives):
            again = drive.overdue(now_ns)
            if again is not None:
                self._ask(i, again)

    def cycle(self, now_ns: int, setpoint_rad: Array | None) -> list[Outgoing]:
        """The frames before a SYNC: heartbeats, and every drive's controlword and target (RPDOs)."""
        if not self._answers.complete:
            self.unanswered += self._cycles > 0
            self._publish()
        fresh = self._answers.fresh
        self._answered_ns[fresh] = now_ns
        self._known_ns[fresh] = self._synced_ns
        if now_ns - self._cycled_ns > self._dead_ns // 2:
            # it was this process that stood still: nobody else was silent
            self._answered_ns[:] = now_ns
            self._heard_ns = [now_ns] * len(self._heard_ns)
        self._cycled_ns = now_ns
        self.pending(now_ns)
        self._look(now_ns, fresh)
        controlwords = self._supervise(fresh, now_ns)
        targets = self._targets(setpoint_rad)
        self._watch.aim(self._target_rad, self._running)
        beat = self._cycles % self._beat_every == 0
        out = [(bus.name, self._beat, bytes([_OPERATIONAL])) for bus in self._config.buses] if beat else []
        data = pdo.pack_targets(controlwords, targets)
        # a drive that may have stopped by itself meanwhile must not be told "enable" unseen: that moves it
        seen = (now_ns - self._known_ns < self._blind_ns).tolist()
        if self.second_master.buses:
            # its controlwords and these would lead each drive to and fro, SYNC by SYNC: NMT has stopped them
            seen = [False] * len(seen)
        frames = zip(self._rpdo, data, seen, strict=True)
        out += [(bus, frame_id, part) for (bus, frame_id), part, told in frames if told]
        self._cycles += 1
        return out

    def sync(self, now_ns: int) -> list[Outgoing]:
        """The SYNCs, to be sent right now."""
        self._answers.begin()
        self._watch.asked()
        self._synced_ns = now_ns
        self.answered_after_ns = None
        return [(bus.name, pdo.SYNC, b"") for bus in self._config.buses]

    @property
    def running(self) -> bool:
        """Whether every drive is enabled."""
        return bool(self._running.all())

    @property
    def failed(self) -> bool:
        """Whether any drive has failed for good."""
        return any(drive.phase is Phase.FAILED for drive in self._drives)

    @property
    def not_running(self) -> dict[str, str]:
        """Drives that do not run, with node, bus and reason, by joint."""
        rows = zip(self._names, self._where, self._drives, strict=True)
        # those that have failed first: the others may only wait
        waiting = sorted(
            (row for row in rows if row[2].phase is not Phase.RUNNING),
            key=lambda row: row[2].phase is not Phase.FAILED,
        )
        return {name: f"node {node} on bus {bus} {drive.words}" for name, (bus, node), drive in waiting}

    def where(self, joint: str) -> tuple[str, int]:
        """Bus and node id of a joint's drive."""
        return self._where[self._names.index(joint)]

    # within

    def _start(self, i: int, now_ns: int, configure: bool) -> None:
        drive = self._drives[i]
        self._joined[i] = self._running[i] = False
        self._settled = False
        self._watch.restart(i)
        first = drive.start(now_ns, self._config.fault_reset, configure)
        if first is not None:
            self._nmt(i, _PRE_OPERATIONAL)
            self._ask(i, first)
        else:
            self._heard_ns[i] = self._answered_ns[i] = now_ns

    def _ask(self, i: int, data: bytes) -> None:
        bus, node = self._where[i]
        self.outbox.append((bus, pdo.SDO_REQUEST + node, data))

    def _operate(self, i: int, now_ns: int) -> None:
        self._heard_ns[i] = self._answered_ns[i] = now_ns
        self._watch.connect(i)
        self._nmt(i, _START)

    def _nmt(self, i: int, command: int) -> None:
        bus, node = self._where[i]
        self.outbox.append((bus, pdo.NMT, bytes([command, node])))

    def _fail(self, i: int, why: str) -> None:
        self._drives[i].fail(why)
        self._settled = False
        self._tell()

    def _look(self, now_ns: int, fresh: Mask) -> None:
        """Let those be enabled that may be, and stop those that do what nobody asked for."""
        words = self._answers.encoder
        seen = Seen(
            self._synced_ns,
            fresh,
            self._answers.statusword,
            fresh & (words & _FLAGS == 0),
            (words & pdo.COUNT_BITS).astype(np.int64),
            self._answers.position,
        )
        self._watch.take(seen)
        if not self._settled:
            self._check(now_ns, seen)
        on = self._running.copy() if self._settled else self._switched_on()
        for i, why in self._watch.judge(seen, on, self._running).items():
            self._fail(i, why)
        warnings = self._watch.warnings(seen)
        if warnings != self.warnings:
            self.warnings = MappingProxyType(warnings)

    def _check(self, now_ns: int, seen: Seen) -> None:
        for i, drive in enumerate(self._drives):
            if drive.phase is Phase.CHECKING and seen.fresh[i] and not self._stopping:
                passed, why = self._watch.check(i, seen)
                if why:
                    self._fail(i, why)
                elif passed:
                    drive.admit(now_ns)

    def _switched_on(self) -> Mask:
        on = (Phase.ENABLING, Phase.RUNNING)
        phases = [drive.phase in on and not self._stopping for drive in self._drives]
        out: Mask = np.array(phases, np.bool_)
        return out

    def _supervise(self, fresh: Mask, now_ns: int) -> NDArray[np.uint16]:
        statusword = self._answers.statusword
        silent = now_ns - np.minimum(self._answered_ns, self._heard_ns) > self._dead_ns
        enabled = statusword & STATE_BITS == ENABLED_BITS
        if self._settled and not silent.any() and enabled[fresh].all():
            # all run, and all that answered are enabled: the words are those of the last time
            return self._words
        words = np.empty_like(self._words)
        for i, drive in enumerate(self._drives):
            if silent[i] and drive.phase in _LISTENED:
                drive.fail("silent: neither heartbeat nor position", reconfigure=True)
            was_running = drive.phase is Phase.RUNNING
            words[i] = drive.controlword(int(statusword[i]), bool(fresh[i]), self._stopping, now_ns)
            self._running[i] = drive.phase is Phase.RUNNING and not self._stopping
            if self._running[i] and not was_running:
                self._joined[i] = False
        self._words = words
        self._tell()
        self._settled = self.running and not self._told
        return words

    def _targets(self, setpoint_rad: Array | None) -> NDArray[np.int32]:
        """Increments: where it stands for a drive that does not run; its setpoint, once it has joined it."""
        position = self._answers.position
        stands_rad = (position - self._zero) / self._scale
        idle = ~self._running
        self._joined[idle] = False
        if setpoint_rad is None:
            self._target_rad = np.where(idle, stands_rad, self._target_rad)
        elif self._joined.all():
            self._target_rad = setpoint_rad
        else:
            way = setpoint_rad - self._target_rad
            towards = self._target_rad + np.clip(way, -self._step_rad, self._step_rad)
            self._joined |= self._running & (np.abs(way) <= self._step_rad)
            self._target_rad = np.where(idle, stands_rad, np.where(self._joined, setpoint_rad, towards))
        wanted = np.rint(self._zero + self._scale * self._target_rad)
        return np.where(idle, position, wanted).astype(np.int32)

    def _publish(self) -> None:
        words = self._answers.encoder
        flags = words & _FLAGS
        counts = (words & pdo.COUNT_BITS).astype(np.int64)
        drive_rad = (self._answers.position - self._zero) / self._scale
        valid = self._answers.fresh & (flags == 0)
        self.reading = EncoderReading(self._synced_ns, counts, valid, drive_rad)
        if (flags != self._flags).any():
            self._flags = flags
            for drive, flag in zip(self._drives, flags.tolist(), strict=True):
                drive.encoder = _encoder_words(flag)
            self._tell()

    def _tell(self) -> None:
        said = {}
        other = self.second_master.words
        for name, (bus, _), drive in zip(self._names, self._where, self._drives, strict=True):
            words = drive.words
            if other:
                words = "; ".join(filter(None, [other, words]))
            if bus in self._down:
                words = "; ".join(filter(None, [f"bus {bus} is down: {self._down[bus]}", words]))
            if words:
                said[name] = words
        if said != self._told:
            self._told = said
            self._settled = False
            self.faults = MappingProxyType(said)


def period_ns(config: CanopenConfig) -> int:
    """Between two SYNCs."""
    return NS_PER_S // config.sync_hz


def _encoder_words(flags: int) -> str:
    said = []
    if flags & pdo.MAGNET_LOST:
        said.append("encoder: magnet lost")
    if flags & pdo.PARITY_ERROR:
        said.append("encoder: parity error")
    return "; ".join(said)
