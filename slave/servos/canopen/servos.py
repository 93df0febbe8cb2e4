"""CiA 402 drives on CAN as the slave's servos: the pure `Drives`, real buses and the clock.

It has no thread and no timer of its own: the slave's ticks drive SYNC and heartbeat. A slave that hangs
therefore falls silent, and the drives stop by themselves.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Mapping

import can
import numpy as np

from common.can.bus import CanBus
from common.can.config import BusConfig
from common.can.controller import Controller
from common.can.frame import CanFrame
from common.can.netlink import ask_kernel
from common.can.without_echo import open_without_function_code
from common.clock import NS_PER_MS, Clock, monotonic_ns, to_ns
from common.errors import RobotError
from common.latency.durations import Durations
from common.metrics.slave import ServoMetrics
from common.quaternion import Array
from common.skeleton import Skeleton
from slave.encoders.counts import EncoderConfig
from slave.servos.canopen.config import CanopenConfig
from slave.servos.canopen.drives import Drives
from slave.servos.canopen.load import WELL, too_much
from slave.servos.canopen.pdo import RPDO1
from slave.servos.canopen.wiring import Outgoing
from slave.servos.servos import EncoderReading, check_setpoint, check_torque_limit
from slave.servos.signs import DriveSigns

log = logging.getLogger(__name__)

_POLL_S = 0.0005
_LISTEN_NS = 250 * NS_PER_MS
"""Before the first frame is sent: SYNC and heartbeat of a second master come several times within this."""
_NAMED = 3
"""At most this many drives are named in a message."""
_EARLY_NS = 2 * NS_PER_MS
"""A setpoint written this long before its SYNC is due goes with it: ticks jitter, SYNC must not skip one."""

log = logging.getLogger(__name__)

Opener = Callable[[BusConfig], can.BusABC]


def open_without_targets(config: BusConfig) -> can.BusABC:
    """A bus that does not hear the targets it sends."""
    return open_without_function_code(config, RPDO1)


class CanopenServos:
    """Servos (see `slave.servos.Servos`) of drives on one or more CAN buses.

    Use it on the thread of a running event loop, on which frames come in. `write` sends every SYNC that is
    due; `read` does where nobody writes, so that encoders are heard from the start.
    """

    def __init__(
        self,
        config: CanopenConfig,
        skeleton: Skeleton,
        clock: Clock = monotonic_ns,
        opener: Opener = open_without_targets,
        *,
        encoders: EncoderConfig | None = None,
        last_known_rad: Mapping[str, float] | None = None,
    ) -> None:
        """`encoders`: how they are mounted at the output shafts; `last_known_rad`: where joints stood."""
        self._config = config
        self._skeleton = skeleton
        self._clock = clock
        self._period_ns = config.period_ns
        self._opener = opener
        self._drives = Drives(config, skeleton, encoders, last_known_rad=last_known_rad or {})
        self._buses: dict[str, CanBus] = {}
        self._setpoint: Array | None = None
        self._torque_nm: Array | None = None
        self._due_ns = 0
        self._spoken = False
        """Whether anything has been sent since the buses were opened."""
        self._answered = Durations()
        self._period = Durations()
        self._synced_ns = 0
        self._warned = self._drives.warnings
        self._fd = {bus.name: bus.fd for bus in config.buses}

    def start(self) -> None:
        """Configure and enable all drives; they hold where they stand. Takes some tenths of a second.

        Raises BusError where a bus cannot be opened, RobotError naming each drive that does not come up.
        """
        if self._buses:
            raise RobotError("the drives run already: stop them before they are started again")
        self._setpoint = self._torque_nm = None
        try:
            for config in self._config.buses:
                bus = CanBus(
                    config, self._on_frame, self._on_change, self._opener, on_second_sender=self._on_frame
                )
                bus.open()
                self._buses[config.name] = bus
                self._check_load(config)
            self._listen()
            self._spoken = True
            self._come_up()
            for joint, words in self._drives.left_out.items():
                log.warning("%s: its drive lacks %s", joint, words)
        except BaseException:
            self.stop()
            raise

    def write(self, position_rad: Array) -> None:
        """Setpoints (J,) for the next SYNC. Raises ValueError if not finite or not J."""
        check_setpoint(position_rad, len(self._skeleton.joints))
        self._setpoint = np.clip(position_rad, self._skeleton.lower_rad, self._skeleton.upper_rad)
        if self._clock() >= self._due_ns - _EARLY_NS:
            self._cycle()

    def limit_torque(self, torque_nm: Array | None) -> None:
        """See `LimitsTorque`: goes with the next SYNC."""
        check_torque_limit(torque_nm, len(self._skeleton.joints))
        self._torque_nm = torque_nm

    @property
    def no_torque_limit(self) -> Mapping[str, str]:
        """See `LimitsTorque`."""
        return self._drives.no_torque_limit

    def read(self) -> EncoderReading:
        """All positions of the newest SYNC that all drives have answered, or that the next has ended."""
        for bus in self._buses.values():
            bus.read()
        if self._clock() >= self._due_ns + self._period_ns // 2:
            self._cycle()
        return self._drives.reading

    def faults(self) -> Mapping[str, str]:
        """What drives, encoders and buses say is wrong, by joint."""
        return self._drives.faults

    def signs(self, joint: str) -> DriveSigns:
        """What the drive of a joint tells of its torque and its digital inputs."""
        return self._drives.signs(joint)

    def quick_stop(self, stop: bool) -> None:
        """Brake and stay, at once; or enable all drives again, those with a fault too (`fault_reset`)."""
        if stop:
            self._drives.stop()
        else:
            self._drives.release(self._clock())
        self._flush()
        self._cycle()

    def stop(self) -> None:
        """Tell the drives to stop and stay, and close the buses."""
        if self._buses and self._spoken:
            self._drives.stop()
            self._cycle()
        self._spoken = False
        for bus in self._buses.values():
            bus.close_now()
        self._buses = {}

    def metrics(self) -> ServoMetrics:
        """Counters and times: SYNC to the last drive's answer, and from SYNC to SYNC."""
        return ServoMetrics(
            counters={
                "unanswered_syncs": self._drives.unanswered,
                "unknown_frames": self._drives.unknown,
                "second_master_frames": self._drives.second_master.frames,
                "warnings": len(self._drives.warnings),
            },
            times_ms={
                "sync_to_positions": self._answered.summary(),
                "sync_period": self._period.summary(),
            },
            buses={name: bus.metrics() for name, bus in self._buses.items()},
            no_effort=self._drives.no_effort,
            left_out=self._drives.left_out,
        )

    def _check_load(self, bus: BusConfig) -> None:
        """The file is checked by the rate it names; the kernel knows the true one."""
        link = ask_kernel(bus.channel) if bus.interface == "socketcan" else None
        if link is None or not link.bitrate:
            return
        count, bits = self._config.load(self._skeleton)[bus.name]
        if words := too_much(count, self._config.sync_hz, bits, link.bitrate):
            raise RobotError(f"bus {bus.name} cannot carry its drives: {words}")
        if bits > WELL * link.bitrate:
            log.warning("bus %s is %.0f %% busy: answers may come late", bus.name, 100 * bits / link.bitrate)

    def _listen(self) -> None:
        """Say nothing for a while: a second master would take this one's first frame for an attack."""
        until_ns = self._clock() + max(3 * self._period_ns, _LISTEN_NS)
        while self._clock() < until_ns:
            for bus in self._buses.values():
                bus.read()
            time.sleep(_POLL_S)
        if other := self._drives.second_master.words:
            raise RobotError(f"{other}; nothing has been sent to the drives")

    def _come_up(self) -> None:
        now_ns = self._clock()
        deadline_ns = now_ns + to_ns(self._config.start_timeout_s)
        self._due_ns = now_ns
        self._drives.start(now_ns)
        self._flush()
        while not self._drives.running:
            now_ns = self._clock()
            for bus in self._buses.values():
                bus.read()
            if now_ns >= self._due_ns:
                self._cycle()
            if self._drives.waiting_for_torque:
                # an emergency stop at the start is no reason not to start: the robot begins stopped
                log.warning("drives are not enabled: %s", self._not_up())
                self._drives.stop()
                return
            if self._drives.failed or now_ns > deadline_ns:
                raise RobotError(self._not_up())
            time.sleep(_POLL_S)

    def _not_up(self) -> str:
        waiting = self._drives.not_running
        named = [f"{joint}: {words}" for joint, words in waiting.items()]
        listed = "; ".join(named[:_NAMED]) + (
            f"; and {len(named) - _NAMED} more" if len(named) > _NAMED else ""
        )
        states = [
            f"the controller of bus {name} is {bus.state}"
            for name, bus in self._buses.items()
            if bus.state not in (None, Controller.ERROR_ACTIVE)
        ]
        listed = "; ".join([listed, *states])
        return (
            f"{len(waiting)} of {len(self._skeleton.joints)} drives do not start: {listed}; check power, "
            "node ids and buses in [servos.canopen]; without hardware, start `tandem drives` on the same file"
        )

    def _cycle(self) -> None:
        now_ns = self._clock()
        drives = self._drives
        for outgoing in drives.cycle(now_ns, self._setpoint, self._torque_nm):
            self._send(outgoing)
        self._flush()
        synced_ns = self._clock()
        for outgoing in drives.sync(synced_ns):
            self._send(outgoing)
        drives.synced(self._clock())
        if drives.warnings is not self._warned:
            self._warned = drives.warnings
            for joint, words in self._warned.items():
                log.warning("%s: %s", joint, words)
        if self._synced_ns:
            self._period.record(synced_ns - self._synced_ns)
        self._synced_ns = synced_ns
        # on the grid while on time; from now where a whole period was missed, or a stop or reset came between
        self._due_ns += self._period_ns
        if not now_ns - _EARLY_NS < self._due_ns <= now_ns + self._period_ns + _EARLY_NS:
            self._due_ns = now_ns + self._period_ns

    def _flush(self) -> None:
        outbox, self._drives.outbox = self._drives.outbox, []
        for outgoing in outbox:
            self._send(outgoing)

    def _send(self, outgoing: Outgoing) -> None:
        name, frame_id, data = outgoing
        bus = self._buses.get(name)
        if bus is not None:
            bus.send(CanFrame(frame_id, data or b"", False, remote=data is None))

    def _on_frame(self, name: str, frame_id: int, data: bytes, now_ns: int) -> None:
        drives = self._drives
        waiting = drives.answered_after_ns is None
        drives.on_frame(name, frame_id, data, now_ns)
        if drives.outbox:
            self._flush()
        if waiting and drives.answered_after_ns is not None and self._synced_ns:
            self._answered.record(drives.answered_after_ns)

    def _on_change(self, name: str, up: bool) -> None:
        bus = self._buses.get(name)
        if bus is not None:
            self._drives.on_bus(name, "" if up else bus.last_error)
