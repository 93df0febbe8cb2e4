"""All servos of a robot on one bus, a cycle at a time, without a thread: what may move, what is wrong."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping

import numpy as np

from common.clock import Clock, to_ns, to_s
from common.errors import RobotError
from common.quaternion import Array
from common.skeleton import Skeleton
from slave.encoders.counts import COUNTS_PER_TURN, Counts, EncoderConfig, Encoders
from slave.servos.dynamixel import registers as x
from slave.servos.dynamixel.bus import Bus, ServoError
from slave.servos.dynamixel.config import WATCHDOG_UNIT_S, DynamixelConfig
from slave.servos.dynamixel.effort import ServoEfforts
from slave.servos.dynamixel.goals import ServoGoals
from slave.servos.dynamixel.latency import advice, timer_ms, too_late
from slave.servos.dynamixel.port import Port, PortLostError
from slave.servos.dynamixel.settings import Settings, settings_of
from slave.servos.dynamixel.startup import arm, cannot_be_used, inspect, inspect_all, prepare
from slave.servos.servos import EncoderReading

log = logging.getLogger(__name__)

_FIRST_PAUSE_NS = to_ns(0.1)
_LONGEST_PAUSE_NS = to_ns(2.0)
_START_PATIENCE_S = 0.05
"""Waited for an answer while servos are made ready: nothing hurries then, and hosts may be busy."""
_TAKE_IN = "it holds until an e-stop is reset"


class Driver:
    """The bus, and the state of each joint's servo. Its methods block for as long as the bus needs.

    A servo with a fault takes no setpoints, and none comes back by itself: `recover` makes it ready
    where it stands, and it moves slowly from there to its setpoint.
    """

    def __init__(
        self,
        config: DynamixelConfig,
        skeleton: Skeleton,
        encoders: EncoderConfig,
        clock: Clock,
        open_port: Callable[[str, int, float], Port] = Port,
    ) -> None:
        """Raises ConfigError where the encoders are not of this skeleton."""
        self._config = config
        self._clock = clock
        self._open_port = open_port
        self._encoders = Encoders(skeleton, encoders)
        self._servos = settings_of(config, skeleton, self._encoders)
        self._joint_of = {servo.id: j for j, servo in enumerate(self._servos)}
        count = len(self._servos)
        self.efforts = ServoEfforts(config, skeleton, encoders)
        self._currents: Counts = np.zeros(count, np.int64)
        self._goals = ServoGoals(config, skeleton, self._encoders, self._servos)
        self._watchdog_ns = to_ns(self._servos[0].watchdog * WATCHDOG_UNIT_S)
        self._bus: Bus | None = None
        self._broken_before = 0
        self._pause_ns = _FIRST_PAUSE_NS
        self._retry_ns = 0
        self._sent_ns = 0
        self._polled = 0
        self._late_before = 0
        self._misses = np.zeros(count, np.int64)
        self._stands: Counts = np.zeros(count, np.int64)  # as the servos tell it: below 0 past their end
        self._faults: dict[str, str] = {}
        self.reading = EncoderReading(clock(), self._stands.copy(), np.zeros(count, np.bool_))
        """The reading of the newest cycle."""
        self.faults: Mapping[str, str] = {}
        """The faults as text, by joint; replaced whole."""
        self.missed = 0
        """Answers that did not come."""
        self.lost = 0
        """Times that the port went."""

    @property
    def broken(self) -> int:
        """Answers that were cut short or failed their checksum."""
        return self._broken_before + (self._bus.broken if self._bus else 0)

    def start(self) -> None:
        """Open the port and make all servos ready. Raises RobotError naming what cannot be used.

        All are looked at before anything is written: a refusal leaves them as they were.
        """
        try:
            bus = self._open()
            with bus.patient(_START_PATIENCE_S):
                wrong = inspect_all(bus, self._servos)
                late = too_late(self._config.port, bus.quickest_s, self._config.reply_timeout_s)
            if wrong or late:
                self._drop()
                raise RobotError(self._refusal(wrong) if wrong else f"{self._config.port}: {late}")
            with bus.patient(_START_PATIENCE_S):
                self.efforts.know({servo.joint: bus.ping(servo.id) for servo in self._servos})
            wrong = self._prepare(self._servos, _START_PATIENCE_S)
        except PortLostError:
            self._drop()
            raise
        if wrong:
            self.close()
            raise RobotError(self._refusal(wrong))
        self._faults.clear()
        self._publish()

    def _refusal(self, wrong: list[tuple[Settings, str]]) -> str:
        return cannot_be_used(self._config.port, len(self._servos), wrong)

    def cycle(self, setpoint_rad: Array | None, stop: bool = False) -> None:
        """Write the setpoints (J,), read the positions, look after one servo's health.

        None: nobody has written yet, hold. `stop`: hold where the servos stand, from the first such
        cycle on. A port that has gone is tried again, seldom.
        """
        try:
            if self._bus is None:
                self._reopen()
            if self._bus is not None:
                self._converse(self._bus, setpoint_rad, stop)
        except PortLostError as error:
            self._lose(error)
        self._publish()

    def recover(self) -> None:
        """Make the servos with faults ready again where they stand; all move slowly to their setpoints."""
        self._goals.rejoin()
        if self._bus is None:
            return
        try:
            # a servo that is silent is asked, waited for, and waited for again: the others must not be kept
            # waiting by it for so long that they stop
            patience_s = to_s(self._watchdog_ns) / 4.0
            faulty = [servo for servo in self._servos if servo.joint in self._faults]
            self._prepare(faulty, min(patience_s, _START_PATIENCE_S), inspected=False)
        except PortLostError as error:
            self._lose(error)
        self._publish()

    def close(self) -> None:
        """Leave the servos holding, their watchdogs off. Safe to call twice."""
        bus = self._bus
        if bus is None:
            return
        try:
            # a servo with a fault keeps the state that tells of it
            well = [servo.id for servo in self._servos if servo.joint not in self._faults]
            bus.write_all(x.BUS_WATCHDOG, dict.fromkeys(well, 0))
            if well:
                # its answer tells that the bytes before are out
                bus.read_bytes(well[0], x.BUS_WATCHDOG, tries=1)
        except ServoError:
            pass
        except PortLostError:
            log.warning("%s: servo port lost; the servos stop by themselves", self._config.port)
        self._drop()

    # the port

    def _open(self) -> Bus:
        config = self._config
        self._bus = Bus(self._open_port(config.port, config.baud, config.reply_timeout_s))
        return self._bus

    def _drop(self) -> None:
        if self._bus is not None:
            self._broken_before = self.broken
            bus, self._bus = self._bus, None
            bus.close()

    def _lose(self, error: PortLostError) -> None:
        if self._bus is not None:
            self.lost += 1
            log.error("servo port lost: %s; retrying", error)
            for servo in self._servos:
                self._faults[servo.joint] = f"servo port lost ({error}); the servos stop by themselves"
            self._goals.rejoin()
        self._drop()
        self._retry_ns = self._clock() + self._pause_ns
        self._pause_ns = min(2 * self._pause_ns, _LONGEST_PAUSE_NS)

    def _reopen(self) -> None:
        if self._clock() < self._retry_ns:
            return
        self._open()
        self._sent_ns = self._clock()
        self._misses[:] = 0
        log.info("%s: servo port open again", self._config.port)
        for servo in self._servos:
            self._faults[servo.joint] = f"servo port was lost; {_TAKE_IN}"

    # the servos

    def _prepare(
        self, servos: list[Settings], patience_s: float, inspected: bool = True
    ) -> list[tuple[Settings, str]]:
        assert self._bus is not None
        with self._bus.patient(patience_s):
            return self._prepare_on(self._bus, servos, inspected)

    def _prepare_on(self, bus: Bus, servos: list[Settings], inspected: bool) -> list[tuple[Settings, str]]:
        wrong = []
        for servo in servos:
            j = self._joint_of[servo.id]
            try:
                if not inspected:
                    inspect(bus, servo)
                self._goals.counts[j] = self._stands[j] = prepare(bus, servo)
            except ServoError as error:
                wrong.append((servo, str(error)))
                self._faults[servo.joint] = str(error)
        failed = {servo.id for servo, _ in wrong}
        # armed together and last: nothing may trip them while the others are made ready
        for servo in servos:
            if servo.id in failed:
                continue
            try:
                arm(bus, servo)
                self._faults.pop(servo.joint, None)
                self._misses[self._joint_of[servo.id]] = 0
            except ServoError as error:
                wrong.append((servo, str(error)))
                self._faults[servo.joint] = str(error)
        self._sent_ns = self._clock()
        return wrong

    def _converse(self, bus: Bus, setpoint_rad: Array | None, stop: bool) -> None:
        self._notice_gap()
        if not self._misses.any():
            self._late_before = bus.late_bytes
        self._goals.aim(setpoint_rad, stop, self._stands)
        well = [j for j, servo in enumerate(self._servos) if servo.joint not in self._faults]
        bus.write_all(x.GOAL_POSITION, {self._servos[j].id: int(self._goals.counts[j]) for j in well})
        present = [j for j in range(len(self._servos)) if self._misses[j] < self._config.silent_after]
        asked_ns = self._clock()
        register = self._config.present
        answers = bus.read_all(register, [self._servos[j].id for j in present])
        valid = np.zeros(len(self._servos), np.bool_)
        for servo, answer in answers.items():
            j = self._joint_of[servo]
            if register is x.PRESENT:
                self._currents[j], self._stands[j] = x.current_and_position(answer.value)
            else:
                self._stands[j] = answer.value
            self._misses[j] = 0
            valid[j] = True
            if answer.alert:
                self._polled = j
        for j in present:
            if not valid[j]:
                self._miss(j)
        # the answers may be as old as the question
        effort_nm = self.efforts.joint_nm(self._currents, valid)
        self.reading = EncoderReading(asked_ns, self._stands % COUNTS_PER_TURN, valid, effort_nm=effort_nm)
        self._look_after(bus, self._polled)
        self._polled = (self._polled + 1) % len(self._servos)
        self._sent_ns = self._clock()
        if valid.any():
            self._pause_ns = _FIRST_PAUSE_NS

    def _notice_gap(self) -> None:
        gap_ns = self._clock() - self._sent_ns
        if gap_ns > self._watchdog_ns:
            for servo in self._servos:
                self._fault(servo, f"stopped by itself: nothing came over the bus for {gap_ns / 1e9:.2f} s")

    def _miss(self, j: int) -> None:
        self.missed += 1
        self._misses[j] += 1
        if self._misses[j] >= self._config.silent_after:
            late = self._bus.late_bytes if self._bus is not None else 0
            words = f"servo {self._servos[j].id} does not answer"
            if late > self._late_before:
                timer = advice(self._config.port, timer_ms(self._config.port))
                words = f"servo {self._servos[j].id} answers too late ({late} bytes came late): {timer}"
            self._fault(self._servos[j], words)

    def _look_after(self, bus: Bus, j: int) -> None:
        """Read one servo's health. One that was silent is asked only here, so it costs one wait a round."""
        servo = self._servos[j]
        try:
            words = x.health_words(bus.read_bytes(servo.id, x.HEALTH, tries=1))
        except ServoError:
            return
        silent = self._misses[j] >= self._config.silent_after
        self._misses[j] = 0
        if silent:
            self._fault(servo, words or f"servo {servo.id} was silent and answers again; {_TAKE_IN}", True)
        elif words:
            self._fault(servo, words)

    def _fault(self, servo: Settings, words: str, instead: bool = False) -> None:
        """Say what is wrong; the first cause stands."""
        if instead or servo.joint not in self._faults:
            log.error("%s (id %d): %s", servo.joint, servo.id, words)
            self._faults[servo.joint] = words
            self._goals.rejoin(self._joint_of[servo.id])

    def _publish(self) -> None:
        if self._bus is None:
            none = np.zeros(len(self._servos), np.bool_)
            self.reading = EncoderReading(self.reading.read_ns, self.reading.counts, none)
        if self.faults != self._faults:
            self.faults = dict(self._faults)
