"""One simulated CiA 402 drive: a CANopen node whose dictionary comes from `drive.eds`.

The `canopen` library answers NMT and SDO (expedited and segmented). SYNC, PDOs and heartbeats, which come
thousands of times a minute, are done here.
"""

from __future__ import annotations

import struct
from typing import Any

import canopen
from canopen.sdo.exceptions import SdoAbortedError

from common.clock import NS_PER_MS
from deploy.sim.drives.faults import CODES, DEMAND, IGNORES_TARGETS, STATUS_BITS, WITHHOLDS, DriveFault
from deploy.sim.drives.machine import after, statusword
from deploy.sim.drives.mapping import GIVEN, TAKEN, PdoLayout, layout
from deploy.sim.drives.torque_off import DROPS, STO_EMERGENCY, inputs, without_torque
from deploy.sim.drives.traits import Reformed, Traits
from deploy.sim.drives.wire import Send, Wire, dictionary
from slave.servos.canopen import pdo
from slave.servos.canopen.cia402 import CYCLIC_SYNCHRONOUS_POSITION, Power
from slave.servos.canopen.status_bits import LIMITED

_RPDO, _TPDO, _TPDOS = 0x1400, 0x1800, range(0x1800, 0x1804)
"""Communication parameters; a PDO's mapping is 200h further on."""
_INVALID = 0x8000_0000
_NO_OBJECT, _PRESENT_STATE = 0x0602_0000, 0x0800_0022
_BOOT, _PRE_OPERATIONAL, _OPERATIONAL = 0x00, 0x7F, 0x05
_RESET_NODE, _RESET_COMMUNICATION = 0x81, 0x82
_PROFILE_POSITION = 1


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
        self.limited = False
        """Whether a limit of its own keeps it from its target."""
        self.state = Power.SWITCH_ON_DISABLED
        self.fault = DriveFault.NONE
        self.traits = Traits()
        self.rebooted = False
        """True once the drive has lost its settings; the reader clears it."""
        self._send_frame = send
        self._controlword = 0
        self._pending: bytes | None = None
        self._pdos: dict[int, PdoLayout] = {}
        """Of the PDOs that are on, by the index of their communication parameters."""
        self._every: dict[int, int] = {}
        """SYNCs between two of each."""
        self._syncs = 0
        self._stuck = 0
        self._beaten_ns = 0
        self._heard_ns: int | None = None
        self._now_ns = 0
        self._reformed = Reformed()
        self._late: list[tuple[int, bytes]] = []
        self._boot()

    def _boot(self) -> None:
        self._node = canopen.LocalNode(self.id, dictionary())
        self._network = Wire(self._send)
        self._node.associate_network(self._network)
        node: Any = self._node  # half of the library is untyped
        node.add_read_callback(self._read)
        node.add_write_callback(self._write)
        self._pdos, self._pending, self._heard_ns = {}, None, None
        # fetched where they are written, as they are needed hundreds of times a second
        self._master_beat = pdo.HEARTBEAT
        self._dead_ns = self._beat_ns = 0
        self._controlword = 0
        self.rebooted = True
        self._send(pdo.HEARTBEAT + self.id, bytes([_BOOT]))
        self._node.nmt._state = _PRE_OPERATIONAL

    # what comes in

    def on_frame(self, frame_id: int, data: bytes, now_ns: int) -> None:
        """NMT, SDO, the targets, and the master's heartbeat."""
        self._now_ns = now_ns
        if frame_id == pdo.RPDO1 + self.id:
            self._pending = data
        elif frame_id == pdo.NMT:
            self._on_nmt(data)
        elif frame_id == self._master_beat and len(data) == 1:
            self._heard_ns = now_ns
        elif frame_id == pdo.SDO_REQUEST + self.id and len(data) == 8:
            segment = self._reformed.segment(data)
            if segment is not None:
                self._answer_sdo(segment)
            else:
                self._network.notify(frame_id, bytearray(data), 0.0)
        else:
            self._network.notify(frame_id, bytearray(data), 0.0)

    def _on_nmt(self, data: bytes) -> None:
        if len(data) != 2 or data[1] not in (0, self.id):
            return
        if data[0] in (_RESET_NODE, _RESET_COMMUNICATION):
            self._lose_connection()
            self._boot()
            return
        self._network.notify(pdo.NMT, bytearray(data), 0.0)
        if not self.operational:
            self._lose_connection()

    @property
    def operational(self) -> bool:
        """Whether PDOs pass."""
        return bool(self._node.nmt._state == _OPERATIONAL)

    def on_sync(self) -> None:
        """Apply what was received since the last SYNC, and report the state."""
        if not self.operational:
            return
        if self._pending is not None and _RPDO in self._pdos:
            form, names = self._pdos[_RPDO]
            if len(self._pending) == form.size:
                taken = dict(zip(names, form.unpack(self._pending), strict=True))
                self.target = taken.get("target", self.target)
                self._command(taken.get("controlword", self._controlword))
            else:
                self._emergency(0x8210, 0x11)
            self._pending = None
        self._syncs += 1
        withheld = WITHHOLDS.get(self.fault, "")
        for index, (form, names) in self._pdos.items():
            if index not in _TPDOS or withheld in names or self._syncs % self._every[index]:
                continue
            now = {
                "statusword": self.statusword, "encoder": self.encoder, "position": self.position,
                "inputs": inputs(self.fault), "thousandths": self.thousandths,
            }  # fmt: skip
            code = pdo.TPDO1 + 0x100 * (index - _TPDO)
            self._send(code + self.id, form.pack(*(now[name] for name in names)))

    def beat(self, now_ns: int) -> None:
        """Send a heartbeat or an answer that is due, and miss the master's heartbeat that is overdue."""
        self._now_ns = now_ns
        while self._late and now_ns >= self._late[0][0]:
            self._send_now(pdo.SDO_ANSWER + self.id, self._late.pop(0)[1])
        if self._beat_ns and now_ns - self._beaten_ns >= self._beat_ns:
            self._beaten_ns = now_ns
            self._send(pdo.HEARTBEAT + self.id, bytes([self._node.nmt._state]))
        if self._heard_ns is not None and self._dead_ns and now_ns - self._heard_ns > self._dead_ns:
            self._heard_ns = None
            if self.state is Power.ENABLED:
                self._emergency(0x8130, 0x11)
            self._lose_connection()

    def at_rest(self) -> None:
        """The motor stands: a fault's reaction is over."""
        if self.state is Power.FAULT_REACTION:
            self.state = Power.FAULT

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
        return word & ~clear | set_

    @property
    def follows(self) -> bool:
        """Whether it goes where its target is."""
        return self.state is Power.ENABLED and self.fault not in IGNORES_TARGETS

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

    def value(self, index: int, subindex: int = 0) -> int:
        """An entry of its dictionary."""
        raw: Any = self._node.object_dictionary[index]
        entry = raw[subindex] if subindex or not hasattr(raw, "decode_raw") else raw
        return int(entry.decode_raw(self._node.get_data(index, subindex)))

    # within

    def _command(self, controlword: int) -> None:
        was = self.state
        if self.fault is DriveFault.LOCAL:
            self._controlword = controlword
            return
        state = after(self.state, controlword, self._controlword, self.traits.knows_16)
        if state is Power.ENABLED and self.value(0x6060) != CYCLIC_SYNCHRONOUS_POSITION:
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
        self._node.set_data(0x603F, 0, code.to_bytes(2, "little"))
        self._node.set_data(0x1001, 0, bytes([register]))
        self._send(pdo.EMERGENCY + self.id, struct.pack("<HB5x", code, register))

    def _send(self, frame_id: int, data: bytes) -> None:
        if frame_id == pdo.SDO_ANSWER + self.id:
            self._answer_sdo(self._reformed.answer(data, self.traits.read_form))
        else:
            self._send_now(frame_id, data)

    def _answer_sdo(self, data: bytes) -> None:
        if self.traits.answers_after_ns:
            self._late.append((self._now_ns + self.traits.answers_after_ns, data))
        else:
            self._send_now(pdo.SDO_ANSWER + self.id, data)

    def _send_now(self, frame_id: int, data: bytes) -> None:
        if self.fault is not DriveFault.SILENT:
            self._send_frame(frame_id, data)

    def _read(self, index: int, subindex: int, **_: object) -> int | None:
        self._must_have(index)
        match index:
            case 0x6041:
                return self.statusword
            case 0x6064:
                return self.position
            case 0x6061:
                return _PROFILE_POSITION if self.fault is DriveFault.WRONG_MODE else self.value(0x6060)
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

    def _must_have(self, index: int) -> None:
        if index in self.traits.lacks:
            raise SdoAbortedError(_NO_OBJECT)

    def _write(self, index: int, subindex: int, data: bytes, **_: object) -> None:
        self._must_have(index)
        if index in (_RPDO, *_TPDOS) and subindex == 1:
            self._activate(index, int.from_bytes(data, "little"))
        elif index - 0x200 in self._pdos:
            raise SdoAbortedError(_PRESENT_STATE)
        elif index == 0x1016:
            consumer = int.from_bytes(data, "little")
            self._master_beat = pdo.HEARTBEAT + (consumer >> 16 & 0x7F)
            self._dead_ns = (consumer & 0xFFFF) * NS_PER_MS
        elif index == 0x1017:
            self._beat_ns = int.from_bytes(data, "little") * NS_PER_MS
        elif index == 0x6040:
            self._command(int.from_bytes(data, "little"))
        elif index == DEMAND:
            if data[0] > max(DriveFault):
                raise SdoAbortedError(0x0609_0030)
            self.happen(DriveFault(data[0]))

    def _activate(self, index: int, cob_id: int) -> None:
        if cob_id & _INVALID:
            self._pdos.pop(index, None)
            return
        entries = index + 0x200
        mapped = [self.value(entries, sub) for sub in range(1, self.value(entries) + 1)]
        self._every[index] = max(1, self.value(index, 2))
        self._pdos[index] = layout(mapped, TAKEN if index == _RPDO else GIVEN)
