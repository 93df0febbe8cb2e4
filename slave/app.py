"""The slave's process: real servos, the real link and a real clock around the pure pipeline."""

from __future__ import annotations

import asyncio
import logging
import os
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import replace

from common.clock import monotonic_ns
from common.clock_sync.services import keep_reference
from common.link import Link, open_session
from common.link.audit import Audit
from common.link.place import own_endpoints
from common.metrics.parts import Ticks
from common.metrics.slave import SlaveMetrics
from common.metrics.tree import WriteMetrics
from common.process.heap import freeze_heap, reserve_heap
from common.process.notify import Notifier, open_notifier
from common.process.pacing import TickGrid
from common.process.realtime import enter_real_time
from common.process.runtime import until_stopped
from common.process.ticker import ticks
from common.tap.sender import open_tap
from common.wire.codec import encode
from common.wire.messages import Statistics
from common.wire.path_probe import answer_probe
from common.wire.presence import ProcessPresence, place
from common.wire.sender import operator_of
from common.wire.topics import (
    CALL,
    CLOCK,
    COMMAND,
    CONTROL,
    PATH,
    STATE,
    STATISTICS,
    STOP,
    SUMMARY,
)  # fmt: skip
from slave.attitude.open import open_base
from slave.attitude.sensor import BaseSensor
from slave.call_button import CallButton
from slave.camera.cameras import open_cameras
from slave.config import SlaveConfig
from slave.guard.body import Body
from slave.guard.states import State
from slave.guard.tilt import base_loss
from slave.last_known import EVERY_S, LastKnown, state_file
from slave.limit.limit import Setpoint
from slave.metrics import servo_metrics, slave_metrics
from slave.pipeline import SlavePipeline
from slave.servos import LimitsTorque, Servos
from slave.servos.servos import EncoderReading
from slave.stop_inputs.robot_stops import RobotStops
from slave.tap import RobotTick, SlaveTap, describe

log = logging.getLogger(__name__)


class Slave:
    """One robot's servo loop and its conversation with the master."""

    def __init__(
        self,
        config: SlaveConfig,
        link: Link,
        servos: Servos,
        base: BaseSensor | None = None,
        notifier: Notifier | None = None,
        *,
        last_known: LastKnown | None = None,
        stops: RobotStops | None = None,
        tap: SlaveTap | None = None,
    ) -> None:
        """`last_known`: the file that keeps the joints' last angles; None: none does.

        `stops`: the emergency stop inputs, started; None: there are none. `tap`: hands each tick to local
        readers; None: there is none.
        """
        self._stops = stops
        self._tap = tap
        self._config = config
        self._link = link
        self._servos = servos
        self._limiting = servos if isinstance(servos, LimitsTorque) else None
        self._base = base
        self._notifier = notifier or Notifier()
        endpoints = own_endpoints(config.link)
        self._pipeline = SlavePipeline(
            config, place=place(endpoints), last_known_rad=last_known.before_rad if last_known else None
        )
        self._last_known = last_known
        self._pipeline.motion.damper.clock = monotonic_ns
        self._pipeline.unread.warn = log.warning
        self._stopped = False
        self._ticks_expected = 0
        self._ticks_missed = 0
        self._put_state: Callable[[bytes], None] = link.publish(STATE)
        self._put_statistics: Callable[[bytes], None] = link.publish(STATISTICS)
        self._put_summary: Callable[[bytes], None] = link.publish(SUMMARY)
        self._button = None if config.call.button is None else CallButton(config.call.button, self._on_button)
        # a recorder at the tap hears what the link would send
        self._cameras = open_cameras(config.camera.all, config.profile, link, always=tap is not None)
        self._pipeline.on_accepted = self._cameras.on_command
        link.subscribe_keys(COMMAND, self._on_command)
        link.answer_keys(CONTROL, self._on_control)
        link.answer(STOP, self._on_stop)
        link.answer(CLOCK, self._on_clock)
        link.answer(PATH, lambda question, _: answer_probe(question))
        link.answer(CALL, self._on_call)
        link.watch_presence(self._on_presence)

    def on_revoked(self, names: frozenset[str]) -> None:
        """Take the names of the revoked certificates."""
        self._pipeline.on_revoked(names, monotonic_ns())

    async def run(self) -> None:
        """Run the servo loop and publish statistics until cancelled."""
        endpoints = own_endpoints(self._config.link)
        profile = self._config.skeleton.name
        self._link.declare_alive("slave", self._pipeline.instance, endpoints, profile)
        with self._cameras, self._button or nullcontext():
            async with asyncio.TaskGroup() as tasks:
                tasks.create_task(self._drive())
                tasks.create_task(self._publish_statistics())
                tasks.create_task(keep_reference(self._config.clock, self._pipeline.clock.tell))
                if self._last_known is not None:
                    tasks.create_task(self._remember(self._last_known))

    async def _remember(self, last_known: LastKnown) -> None:
        """Save the joints' angles now and then, once they are known. In a thread: disks stall."""
        while True:
            await asyncio.sleep(EVERY_S)
            position_rad = self._pipeline.position_rad
            if self._pipeline.guard.placed and last_known.due(position_rad):
                await asyncio.to_thread(last_known.keep, position_rad.copy())

    def remember_last(self) -> None:
        """Save them once more, at the end."""
        if self._last_known is not None and self._pipeline.guard.placed:
            self._last_known.keep(self._pipeline.position_rad.copy())

    async def _drive(self) -> None:
        loop = self._config.loop
        period_ns = round(1e9 / loop.rate_hz)
        logged, published, namesake = "", -1, self._pipeline.namesake
        async for due in ticks(TickGrid(monotonic_ns() + period_ns, period_ns)):
            self._ticks_expected += 1 + due.missed
            self._ticks_missed += due.missed
            body = self._body()
            reading = self._servos.read()
            setpoint = self._pipeline.tick(monotonic_ns(), reading, body)
            self._brake_drives(self._pipeline.guard.state is State.ESTOP)
            if setpoint.ready:
                if self._limiting is not None:
                    self._limiting.limit_torque(setpoint.torque_nm)
                self._servos.write(setpoint.position_rad)
                self._pipeline.written(monotonic_ns())
            if self._tap is not None:
                self._hand_on(self._tap, reading, setpoint)
            self._cameras.look(self._pipeline.position_rad, reading.read_ns)
            self._pipeline.camera_fault = self._cameras.fault
            # a missed tick's state is published by the next one, or an overloaded robot would seem dead
            if due.tick // loop.state_every != published:
                published = due.tick // loop.state_every
                self._put_state(self._pipeline.state(monotonic_ns()))
                summary = self._pipeline.summary(monotonic_ns())
                if summary is not None:
                    self._put_summary(summary)
            guard = self._pipeline.guard
            if namesake != self._pipeline.namesake:
                namesake = self._pipeline.namesake
                log.warning("%s: %s", self._config.robot, namesake or "no other robot has this name any more")
            if guard.state != logged:
                logged = guard.state
                log.info("%s: %s: %s", self._config.robot, guard.state, guard.reason)
                self._notifier.status(f"{guard.state}: {guard.reason}")
            self._notifier.beat(monotonic_ns())  # last, so that a servo or sensor that hangs is noticed too

    def _hand_on(self, tap: SlaveTap, reading: EncoderReading, setpoint: Setpoint) -> None:
        guard = self._pipeline.guard
        written, read = setpoint.position_rad, self._pipeline.position_rad
        target = self._pipeline.motion.target
        asked = None if target is None else target.position_rad
        tick = RobotTick(monotonic_ns(), reading.read_ns, setpoint.ready, written, read, reading.valid, asked)
        tap.tick(tick, str(guard.state), guard.reason)

    def _body(self) -> Body:
        attitude = self._pipeline.base = None if self._base is None else self._base.read()
        # the clock after the reading, or a thread's fresh one would be from the future
        now_ns = monotonic_ns()
        base = None if self._base is None else base_loss(attitude, now_ns, self._config.guard)
        stops = {} if self._stops is None else self._stops.read(now_ns)
        video = self._cameras.loss(now_ns, self._config.guard)
        return Body(self._servos.faults(), base, stops=stops, video=video)

    def _brake_drives(self, stop: bool) -> None:
        """On an e-stop the drives also brake by themselves, whatever happens to this process."""
        if stop != self._stopped:
            self._stopped = stop
            self._servos.quick_stop(stop)

    def _on_presence(self, presence: ProcessPresence, here: bool) -> None:
        self._pipeline.namesakes.on_presence(presence, here)
        if here and presence.other_version and presence.role == "master":
            log.warning("%s: %s", self._config.robot, presence.other_version)

    def _on_command(self, key: str, payload: bytes, received_ns: int) -> None:
        self._pipeline.on_command(payload, received_ns, monotonic_ns(), sender=operator_of(key))

    def _on_control(self, key: str, payload: bytes, _: int) -> bytes:
        return self._pipeline.on_control(payload, monotonic_ns(), sender=operator_of(key))

    def _on_stop(self, payload: bytes, _: int) -> bytes:
        return self._pipeline.on_stop(payload, monotonic_ns())

    def _on_call(self, payload: bytes, _: int) -> bytes:
        return self._pipeline.announcer.on_call(payload, self._pipeline.guard, monotonic_ns())

    def _on_button(self) -> None:
        words = self._pipeline.announcer.pressed(self._pipeline.guard, monotonic_ns())
        log.info("%s: call button: %s", self._config.robot, words)

    def _on_clock(self, payload: bytes, received_ns: int) -> bytes:
        return self._pipeline.on_clock(payload, received_ns, monotonic_ns())

    async def _publish_statistics(self) -> None:
        asked_ms = 0
        async for due in ticks(TickGrid(monotonic_ns(), round(1e9 / STATISTICS.rate_hz))):
            metrics = replace(
                self.metrics(),
                one_way_recent_us=self._pipeline.traffic.one_way.take_recent(),
                one_way_missing_recent_us=self._pipeline.traffic.due.recent.take_recent(),
            )
            self._put_statistics(encode(Statistics(due.scheduled_ns, metrics)))
            rate = self._pipeline.traffic.rate
            if asked_ms not in (0, rate.period_ms):
                hz, words = 1e3 / rate.period_ms, rate.words
                log.info("%s: asks for %g commands a second: %s", self._config.robot, hz, words)
            asked_ms = rate.period_ms

    def metrics(self) -> SlaveMetrics:
        """Counters and percentiles for tables and reports."""
        return slave_metrics(
            self._pipeline,
            monotonic_ns(),
            ticks=Ticks(self._ticks_expected, self._ticks_missed),
            base=self._base.counters() if self._base else {},
            servos=servo_metrics(self._servos, self._config),
            video=self._cameras.main_metrics(),
            other_videos=self._cameras.other_metrics(),
            lenses=self._cameras.lenses,
            link=self._link.counters(),
            paths=self._link.paths,
        )


async def run(config: SlaveConfig, stop: asyncio.Event, write_metrics: WriteMetrics) -> None:
    """Run a slave until `stop` is set; the servos are left holding. Raises LinkError or RobotError."""
    await until_stopped(stop, _run(config, write_metrics))
    log.info("slave stopped; the servos hold their position")


async def _run(config: SlaveConfig, write_metrics: WriteMetrics) -> None:
    notifier = open_notifier()
    last_known = None
    if config.servos.remembers:
        last_known = LastKnown(state_file(config.robot, os.environ), config.skeleton.joint_names)
    before_rad = last_known.before_rad if last_known else None
    servos = config.servos.open(config.skeleton, config.encoders, before_rad)
    base = open_base(config.base)
    stops = RobotStops(config.estop, servos)
    # after a simulator has been built, which takes long; before any thread starts, so that each has it
    enter_real_time(config.process.realtime_priority)
    try:
        if base is not None:
            base.start()
        # before the drives are: a robot whose button is pressed at the start begins in an e-stop
        stops.start()
        audit = Audit(config.link)
        async with open_session(config.link, waits=notifier.waits) as session:
            audit.attach(session)
            sender = open_tap(config.tap, describe(config.robot, config.skeleton))
            tap = None if sender is None else SlaveTap(sender)
            session.overheard = None if tap is None else tap.overhear
            link = session.link(config.robot)
            slave = Slave(config, link, servos, base, notifier, last_known=last_known, stops=stops, tap=tap)
            session.watch_revoked(slave.on_revoked)
            where = ", ".join(config.link.listen or config.link.connect)
            log.info("%s: waiting for a master at %s", config.robot, where)
            # the simulator came after the first freeze: to collect what it built takes longer than a tick
            freeze_heap()
            reserve_heap()
            # last: drives on a bus stop by themselves when they miss the loop's ticks
            servos.start()
            try:
                await slave.run()
            finally:
                notifier.stopping()
                slave.remember_last()
                if sender is not None:
                    sender.close()
                write_metrics(replace(slave.metrics(), access=audit.metrics()))
    finally:
        servos.stop()
        stops.stop()
        if base is not None:
            base.stop()
