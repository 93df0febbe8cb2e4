"""One simulated CiA 402 drive: its power states, its mode, and what it says at each SYNC.

SYNC, PDOs and heartbeats, which come thousands of times a minute, are done here, SDO and NMT in `server.py`.
"""

from __future__ import annotations

import struct

from canopen.sdo.exceptions import SdoAbortedError

from common.clock import NS_PER_MS
from deploy.sim.drives.faults import CODES, DEMAND, IGNORES_TARGETS, STATUS_BITS, WITHHOLDS, DriveFault
from deploy.sim.drives.machine import after, statusword
from deploy.sim.drives.mapping import TAKEN, MappedPdos
from deploy.sim.drives.server import ObjectServer
from deploy.sim.drives.torque_off import DROPS, STO_EMERGENCY, inputs, without_torque
from deploy.sim.drives.traits import Traits
from deploy.sim.drives.watched import MasterWatch, RpdoTimers
from deploy.sim.drives.wire import Send
from slave.servos.canopen import pdo
from slave.servos.canopen.cia402 import CYCLIC_SYNCHRONOUS_POSITION, INTERPOLATED_POSITION, Power
from slave.servos.canopen.mapping import RPDOS, TPDOS
from slave.servos.canopen.status_bits import FOLLOWS, LIMITED

_PRESENT_STATE, _OUT_OF_RANGE, _TOO_HIGH = 0x0800_0022, 0x0609_0030, 0x0609_0031
_SYNC_LENGTH, _PDO_MISSED, _COMMUNICATION = 0x8240, 0x8250, 0x11
"""Emergency codes of a SYNC without the counter asked for, and of an RPDO's event timer; the register."""
_BOOT = 0x00
_RESET_NODE, _RESET_COMMUNICATION = 0x81, 0x82
_PROFILE_POSITION, _HOMING = 1, 6
_INTERPOLATES = 1 << 4
"""Controlword: in interpolated position mode, follow."""
_QUICK_STOP_OPTION = 0x605A
_LIMITS = {index: TAKEN[index] for index in (0x60E0, 0x60E1, 0x6072)}
_MAPPINGS = 0x200
"""From a PDO's communication parameters to its mapping."""


class SimulatedDrive:
    """A drive without its motor: `target` is what it wants, `position` and `count` are its readings."""

    def __init__(self, node_id: int, send: Send, serial: int = 1) -> None:
        self.id = node_id
        self._serial = serial
        self.position = 0
        """Increments."""
        self.count = 0
        """The output encoder's count."""
        self.thousandths = 0
        """Torque and current of the motor, of their ratings."""
        self.rated_torque_mnm = 0
        """6076h."""
        self.target = 0
        self.torque_limits: dict[str, int] = {}
        """60E0h, 60E1h and 6072h by their names in `mapping`, thousandths of its rating, once written."""
        self.limited = False
        """Whether a limit of its own keeps it from its target."""
        self.state = Power.SWITCH_ON_DISABLED
        self.fault = DriveFault.NONE
        self.traits = Traits()
        self.rebooted = False
        """True once the drive has lost its settings; the reader clears it."""
        self._send_frame = send
        self._controlword = 0
        self._stuck = 0
        self._beaten_ns = 0
        self._powered_ns: int | None = None
        """Since when it has power and is not up yet; None: it is up."""
        self._now_ns = 0
        self._boot()

    def _boot(self) -> None:
        self.server = ObjectServer(self.id, self._send, self.traits, on_read=self._read, on_write=self._write)
        self.value = self.server.value
        self._pdos, self._master = MappedPdos(self.value), MasterWatch()
        # fetched where they are written, as they are needed hundreds of times a second
        self._beat_ns = self._mode = self._mode_after = 0
        self._controlword, self.torque_limits = 0, {}
        self._counted_syncs = self.traits.presets.get((0x1019, 0), 0)
        self._timers = RpdoTimers({index: self.traits.presets.get((index, 5), 0) for index in RPDOS})
        self._booted_ns = self._now_ns
        self._boots_again = self.traits.boots_again_after_ns > 0
        for index in (*RPDOS, *TPDOS):
            if (index + _MAPPINGS, 0) in self.traits.presets and index not in self.traits.lacks:
                self._pdos.activate(index, self.value(index, 1))
        self.rebooted = True
        self._send(pdo.HEARTBEAT + self.id, bytes([_BOOT]))

    def become(self, traits: Traits) -> None:
        """Another maker's drive, as it is after power comes."""
        self.traits = traits
        self._powered_ns = self._now_ns if traits.boots_after_ns else None
        self._send_frame, send = (lambda frame_id, data: None), self._send_frame
        self._boot()
        self._send_frame = send

    # what comes in

    def on_remote(self, frame_id: int, now_ns: int) -> None:
        """A remote request: node guarding asks for the state."""
        self._now_ns = now_ns
        guarded = self._master.guard_ns and not self._beat_ns and self._powered_ns is None
        if frame_id == pdo.HEARTBEAT + self.id and guarded:
            toggle = self._master.asked(now_ns)
            self._send(frame_id, bytes([toggle | self.server.state]))

    def on_frame(self, frame_id: int, data: bytes, now_ns: int) -> None:
        """NMT, SDO, the targets, and the master's heartbeat."""
        self._now_ns = now_ns
        if self._powered_ns is not None:
            return
        if self._pdos.take(frame_id, data):
            self._timers.heard(now_ns)
            return
        if frame_id == pdo.NMT:
            self._on_nmt(data)
        elif frame_id == self._master.beat_id and len(data) == 1:
            self._master.heard(now_ns)
        else:
            self.server.on_frame(frame_id, data, now_ns)

    def _on_nmt(self, data: bytes) -> None:
        if len(data) != 2 or data[1] not in (0, self.id):
            return
        if data[0] in (_RESET_NODE, _RESET_COMMUNICATION):
            self._lose_connection()
            self._boot()
            return
        self.server.on_frame(pdo.NMT, data, self._now_ns)
        if not self.server.operational:
            self._lose_connection()

    def on_sync(self) -> None:
        """Apply what was received since the last SYNC, and report the state."""
        self._mode_after = max(0, self._mode_after - 1)
        if not self.server.operational:
            return
        if self._counted_syncs:
            self._emergency(_SYNC_LENGTH, _COMMUNICATION)
            return
        taken = self._pdos.taken()
        if taken is None:
            self._emergency(0x8210, 0x11)
        elif taken:
            self.target = taken.get("target", self.target)
            self.torque_limits.update({name: taken[name] for name in _LIMITS.values() if name in taken})
            self._command(taken.get("controlword", self._controlword))
        now = {
            "statusword": self.statusword, "encoder": self.encoder, "position": self.position,
            "inputs": inputs(self.fault), "thousandths": self.thousandths, "mode": self.mode, "velocity": 0,
        }  # fmt: skip
        for frame_id, data in self._pdos.given(now, WITHHOLDS.get(self.fault, "")):
            self._send(frame_id, data)

    def beat(self, now_ns: int) -> None:
        """Send a heartbeat or an answer that is due, and miss the master's heartbeat that is overdue."""
        self._now_ns = now_ns
        if self._powered_ns is not None:
            if now_ns - self._powered_ns < self.traits.boots_after_ns:
                return
            self._powered_ns, self._booted_ns = None, now_ns
            self._send(pdo.HEARTBEAT + self.id, bytes([_BOOT]))
        if self._boots_again and now_ns - self._booted_ns >= self.traits.boots_again_after_ns:
            self._boots_again = False
            self._send(pdo.HEARTBEAT + self.id, bytes([_BOOT]))
        if self._timers.expired(now_ns, self._pdos.on):
            self._emergency(_PDO_MISSED, _COMMUNICATION)
            self._lose_connection()
        self.server.release(now_ns)
        if self._beat_ns and now_ns - self._beaten_ns >= self._beat_ns:
            self._beaten_ns = now_ns
            self._send(pdo.HEARTBEAT + self.id, bytes([self.server.state]))
        if self._master.gone(now_ns):
            if self.state is Power.ENABLED:
                self._emergency(0x8130, 0x11)
            self._lose_connection()

    def at_rest(self) -> None:
        """The motor stands: a fault's reaction is over, and a quick stop after which it lets go (605Ah)."""
        if self.state is Power.FAULT_REACTION:
            self.state = Power.FAULT
        elif self.state is Power.QUICK_STOP and _QUICK_STOP_OPTION in self.traits.lacks:
            self.state = Power.SWITCH_ON_DISABLED

    def fail(self, code: int, register: int) -> None:
        """A fault of the drive's own: tell it, brake, and stay in fault until it is reset."""
        if self.state not in (Power.FAULT, Power.FAULT_REACTION):
            self._emergency(code, register)
            self.state = Power.FAULT_REACTION

    def happen(self, fault: DriveFault) -> None:
        """A fault on demand; NONE ends what lasts."""
        self._stuck = self.count
        self.fault, self.limited = fault, False
        if fault in CODES:
            self.fail(*CODES[fault])
        elif fault in (*DROPS, DriveFault.STO_FAULT):
            self._lose_torque(self.state)
        elif fault is DriveFault.RESTART:
            self.fault = DriveFault.NONE
            self._lose_connection()
            self._boot()

    # what it says

    @property
    def statusword(self) -> int:
        """6041h."""
        word = statusword(self.state) | (LIMITED if self.limited else 0)
        clear, set_ = STATUS_BITS.get(self.fault, (0, 0))
        if self.mode == _HOMING:
            word = word & ~FOLLOWS | (FOLLOWS if self.traits.homed else 0)
        elif not self._interpolates:
            word &= ~FOLLOWS
        return (word & ~clear | set_) & ~self.traits.never_set | self.traits.always_set

    @property
    def follows(self) -> bool:
        """Whether it goes where its target is."""
        return self.state is Power.ENABLED and self.fault not in IGNORES_TARGETS and self._interpolates

    @property
    def mode(self) -> int:
        """6061h."""
        if self.fault is DriveFault.WRONG_MODE:
            return _PROFILE_POSITION
        return 0 if self._mode_after else self._mode

    @property
    def _interpolates(self) -> bool:
        """Whether nothing but its power state keeps it from following; in mode 7 bit 4 is needed too."""
        return self.mode != INTERPOLATED_POSITION or bool(self._controlword & _INTERPOLATES)

    @property
    def tells_against_position(self) -> bool:
        """Whether only one of position and torque is turned round (607Eh, bits 7 and 5)."""
        return bool(self.traits.polarity & 0x80) != bool(self.traits.polarity & 0x20)

    @property
    def encoder(self) -> int:
        """The encoder's word (2000h)."""
        if self.fault is DriveFault.ENCODER_ZERO:
            return 0
        if self.fault is DriveFault.ENCODER_STUCK:
            return self._stuck
        flags = {DriveFault.MAGNET_LOST: pdo.MAGNET_LOST, DriveFault.PARITY: pdo.PARITY_ERROR}
        return self.count | flags.get(self.fault, 0)

    # within

    def _command(self, controlword: int) -> None:
        was = self.state
        if self.fault is DriveFault.LOCAL:
            self._controlword = controlword
            return
        state = after(self.state, controlword, self._controlword, self.traits.knows_16)
        if state is Power.ENABLED and self._mode not in (CYCLIC_SYNCHRONOUS_POSITION, INTERPOLATED_POSITION):
            state = was
        self.state, self._controlword = state, controlword
        self._lose_torque(was)
        state = self.state
        recovered = was is Power.FAULT or (was is Power.QUICK_STOP and state is Power.ENABLED)
        if recovered and state is not was and self.value(0x603F):
            if self.fault in CODES:
                self.fault = DriveFault.NONE
            self._emergency(0, 0)

    def _lose_torque(self, was: Power) -> None:
        before, self.state = self.state, without_torque(self.fault, was, self.state)
        if (
            self.fault is DriveFault.STO_FAULT
            and self.state is Power.FAULT
            and Power.FAULT not in (before, was)
        ):
            self._emergency(*STO_EMERGENCY)

    def _lose_connection(self) -> None:
        if self.state is Power.ENABLED:
            self.state = Power.QUICK_STOP

    def _emergency(self, code: int, register: int) -> None:
        self.server.store(0x603F, 0, code.to_bytes(2, "little"))
        self.server.store(0x1001, 0, bytes([register]))
        self._send(pdo.EMERGENCY + self.id, struct.pack("<HB5x", code, register))

    def _send(self, frame_id: int, data: bytes) -> None:
        if self.fault is not DriveFault.SILENT:
            self._send_frame(frame_id, data)

    def _read(self, index: int, subindex: int) -> int | None:
        match index:
            case 0x6041:
                return self.statusword
            case 0x6064:
                return self.position
            case 0x6061:
                return self.mode
            case 0x1018 if subindex == 4:
                return self._serial
            case pdo.ENCODER:
                return self.encoder
            case pdo.INPUTS:
                return inputs(self.fault)
            case pdo.TORQUE | pdo.CURRENT:
                return self.thousandths
            case 0x6076:
                return self.rated_torque_mnm
            case 0x607E:
                return self.traits.polarity
        return None

    def _write(self, index: int, subindex: int, data: bytes) -> None:
        value = int.from_bytes(data, "little")
        parameters = index - _MAPPINGS
        if index in (*RPDOS, *TPDOS) and subindex == 1:
            self._pdos.activate(index, value)
            return
        if index in RPDOS and subindex == 5:
            self._timers.ms[index] = value
        if parameters in self.traits.fixed_ids:
            if subindex == 0:
                self._pdos.activate(parameters, self.value(parameters, 1), value)
            return
        if self._pdos.on(parameters):
            raise SdoAbortedError(_PRESENT_STATE)
        match index:
            case 0x1016:
                self._master.consumer(value)
            case 0x1017:
                self._beat_ns = value * NS_PER_MS
            case 0x100C:
                self._master.guard_ns = value * NS_PER_MS
            case 0x100D:
                self._master.life_factor = value
            case 0x1019:
                self._counted_syncs = value
            case 0x60C2 if subindex == 1 and 0 < self.traits.longest_period_ms < value:
                raise SdoAbortedError(_TOO_HIGH)
            case 0x6040:
                self._command(value)
            case _ if index in _LIMITS:
                self.torque_limits[_LIMITS[index]] = value
            case 0x6060:
                self._mode_after = self.traits.mode_after_syncs if value != self._mode else 0
                self._mode = value
            case _ if index == DEMAND:
                if value > max(DriveFault):
                    raise SdoAbortedError(_OUT_OF_RANGE)
                self.happen(DriveFault(value))
