"""The joints as the drives' own buses show them, whatever becomes of the slave."""

from __future__ import annotations

import threading

import can
import numpy as np

from common.can.interface import open_bus
from common.clock import monotonic_ns, to_ns, to_s
from common.config.load import load_config
from common.quaternion import Array
from common.skeleton import Skeleton
from deploy.examples.profiles import NURSING, example
from deploy.harness.rig import drive_buses
from deploy.measure.stillness import StoppingMotion
from slave.config import SlaveConfig
from slave.encoders.counts import Encoders
from slave.servos.canopen.config import CanopenConfig
from slave.servos.canopen.pdo import COUNT_BITS, SYNC, TPDO1

SYNC_S = 0.02


class DriveEncoders:
    """Listens on the drives' buses in a thread of its own, and sends SYNC where nobody else does any more."""

    def __init__(self, can_port: int, skeleton: Skeleton) -> None:
        self._skeleton = skeleton
        overrides = ['servos.backend="canopen"', *drive_buses(can_port)]
        config = load_config(example("slave", NURSING), SlaveConfig, overrides)
        canopen = config.servos.section(CanopenConfig)
        self._buses = {bus.name: open_bus(bus) for bus in canopen.buses}
        self._joints = {
            (drive.bus, TPDO1 + drive.id): joint
            for joint, drive in enumerate(canopen.drives_of(skeleton).values())
        }
        self._encoders = Encoders(skeleton, config.encoders)
        self._counts = np.zeros(len(skeleton.joints), np.int64)
        self._heard_ns = np.zeros(len(skeleton.joints), np.int64)
        self._noted_ns = 0
        self._seen: list[tuple[int, Array]] = []
        self._stop = threading.Event()
        self.sync = False
        self._thread = threading.Thread(target=self._listen, name="encoders", daemon=True)

    def __enter__(self) -> DriveEncoders:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._thread.join()
        for bus in self._buses.values():
            bus.shutdown()

    @property
    def rows(self) -> int:
        """Readings of the whole robot so far."""
        return len(self._seen)

    def silent(self) -> list[str]:
        """Joints whose encoders were not heard in the last 0.1 s."""
        late = monotonic_ns() - self._heard_ns > to_ns(5.0 * SYNC_S)
        return [name for name, silent in zip(self._skeleton.joint_names, late, strict=True) if silent]

    def course(self, fault_ns: int) -> StoppingMotion:
        """What the encoders showed; where they came to rest stands for the last setpoint."""
        rows = [row for row in list(self._seen) if row[0] >= fault_ns - to_ns(0.2)]
        encoder = np.array([position for _, position in rows])
        at_s = np.array([to_s(at_ns - fault_ns) for at_ns, _ in rows])
        return StoppingMotion(at_s, np.broadcast_to(encoder[-1], encoder.shape), encoder)

    def _listen(self) -> None:
        due_ns = 0
        while not self._stop.is_set():
            if self.sync and monotonic_ns() >= due_ns:
                due_ns = monotonic_ns() + to_ns(SYNC_S)
                for bus in self._buses.values():
                    bus.send(can.Message(arbitration_id=SYNC, is_extended_id=False))
            for name, bus in self._buses.items():
                # a few at a time: a bus that is never silent must not keep the other waiting
                for _ in range(len(self._counts)):
                    message = bus.recv(0.001)
                    if message is None:
                        break
                    self._take(name, message)
            self._note()

    def _take(self, bus: str, message: can.Message) -> None:
        joint = self._joints.get((bus, message.arbitration_id))
        if joint is not None and len(message.data) >= 4:
            self._counts[joint] = int.from_bytes(message.data[2:4], "little") & COUNT_BITS
            self._heard_ns[joint] = monotonic_ns()

    def _note(self) -> None:
        """A row a period, unless a drive was not heard lately: what is not known must not look still."""
        now_ns = monotonic_ns()
        if now_ns - self._noted_ns >= to_ns(SYNC_S) and now_ns - self._heard_ns.min() <= to_ns(5.0 * SYNC_S):
            self._noted_ns = now_ns
            self._seen.append((now_ns, self._encoders.position_rad(self._counts)))
