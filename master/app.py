"""The master's process: real buses, the real link and a real clock around the pure pipeline."""

from __future__ import annotations

import asyncio
import logging
import signal
from contextlib import suppress
from dataclasses import replace

from common.can.bus import CanBus
from common.clock import monotonic_ns, to_ns
from common.inputs.key_state import KeyState
from common.inputs.pressed import PressedKey
from common.latency.budget import StageTimes
from common.latency.durations import Durations
from common.link import LinkSession, open_session
from common.link.audit import Audit
from common.link.certificates import check_keys, check_operator
from common.link.place import own_endpoints
from common.log.handler import BELL
from common.metrics.master import MasterMetrics
from common.metrics.parts import Ticks
from common.metrics.tree import WriteMetrics
from common.process.heap import freeze_heap, heap_in_use, reserve_heap
from common.process.notify import Notifier, open_notifier
from common.process.pacing import TickGrid
from common.process.realtime import enter_real_time
from common.process.runtime import until_stopped
from common.process.ticker import ticks
from common.tap.sender import TapSender, open_tap
from common.wire.topics import STATISTICS
from common.wire.version import software
from master.alarms.operator import OperatorAlarms
from master.alarms.player import TonePlayer
from master.capture.source import with_extended
from master.command_rate import CommandRate, RateLog
from master.config import MasterConfig
from master.deadman.grip import Grip
from master.deadman.switches import Switches
from master.fleet import Fleet
from master.joint_angles.sample import JointAngleSample
from master.journal.calls import Pipeline
from master.journal.context import describe
from master.journal.tap import MasterTap
from master.pipeline import MasterPipeline
from master.suit.doubt import DoubtLog, as_figures
from master.suit.protocol import SuitProtocol
from master.suit.silence import BusSigns, SilenceWatch

log = logging.getLogger(__name__)

ALARM_PERIOD_NS = to_ns(0.05)


class Master:
    """One operator's capture loop: joint angles are computed once a posture and sent to every robot."""

    def __init__(
        self,
        config: MasterConfig,
        session: LinkSession,
        notifier: Notifier | None = None,
        tap: TapSender | None = None,
    ) -> None:
        """`tap`: hands what this process hears, decides and sends to local readers; None: there is none."""
        self._config = config
        self._session = session
        self._notifier = notifier or Notifier()
        self._pipeline = MasterPipeline(config, SuitProtocol.load(config.capture.dbc))
        self._calls: Pipeline = self._pipeline
        """What is called while the suit is polled."""
        self._tap: MasterTap | None = None
        if tap is not None:
            self._tap = MasterTap(self._pipeline, tap)
            self._calls = self._tap.pipeline
            session.overheard = self._tap.overhear
        self._stages = StageTimes("sampled→frames in", "frames in→joint angles", "joint angles→put")
        self._frames_in_to_put = Durations()
        self._ticks_expected = 0
        self._ticks_missed = 0
        self._newest: JointAngleSample | None = None
        self._switches = Switches(
            config.operator.deadman,
            config.operator.clutch,
            config.capture.dbc,
            self._pipeline.poll.identifiers,
            config.operator.zero_pose_again.key,
        )
        only_free_running = self._only_free_running()
        self._buses = [
            CanBus(
                bus,
                self._on_frame,
                self._on_bus,
                on_second_sender=self._on_frame,
                take_extended=bus.name in with_extended(self._pipeline.poll.identifiers),
                in_batches=bus.name in only_free_running,
                on_frames=self._on_frames if bus.name in only_free_running else None,
            )
            for bus in config.capture.buses
        ]
        self._fleet = Fleet(config, session, self._pipeline.skeleton)
        self._rate = CommandRate(config.capture.rate)
        self._rate_log = RateLog()
        self._pressed = PressedKey()
        self._silence = SilenceWatch()
        self._alarms = OperatorAlarms()
        self._player = TonePlayer(config.alarms)
        self._doubt_log = DoubtLog()

    def _only_free_running(self) -> frozenset[str]:
        """Buses of which no frame is waited for: they are read once a tick."""
        poll = self._pipeline.poll
        return poll.buses_with_nodes - poll.sync_buses - self._switches.buses

    async def run(self) -> None:
        """Capture, send, keep each robot's lease and clock until cancelled."""
        try:
            for bus in self._buses:
                bus.open_or_retry()
            self._switches.start(self._send_at_once, self._on_zero_pose_key)
            async with asyncio.TaskGroup() as tasks:
                tasks.create_task(self._capture())
                tasks.create_task(self._publish_metrics())
                if not self._config.alarms.off:
                    self._player.start()
                    tasks.create_task(self._sound())
                self._fleet.start(tasks)
        finally:
            self._switches.close()
            await asyncio.to_thread(self._player.stop)
            for bus in self._buses:
                await bus.close()

    async def _capture(self) -> None:
        period_ns = round(1e9 / self._config.capture.rate_hz)
        sync_buses = self._pipeline.poll.sync_buses
        async for due in ticks(TickGrid(monotonic_ns() + period_ns, period_ns)):
            self._ticks_expected += 1 + due.missed
            self._ticks_missed += due.missed
            for bus in self._buses:
                bus.read()  # answers that have arrived are not late, even if this tick runs late
            sync, late = self._calls.tick(due.tick, monotonic_ns())
            for bus in self._buses:
                if bus.name in sync_buses:
                    bus.send(sync)
            if late is not None:
                self._send(late)
                if self._tap is not None:  # the way of a suit of which no node is asked
                    self._tap.rest(monotonic_ns())
            if due.tick % self._config.capture.rate.usual == 0:
                self._follow_lines()
            self._notifier.beat(monotonic_ns())

    def _follow_lines(self) -> None:
        """Send as many commands a second as the robots' lines allow."""
        changed = self._rate.follow(self._fleet.wanted_ms)
        if changed:
            self._calls.set_decimation(self._rate.decimation)
        line = self._rate_log.line(changed, self._rate.words, monotonic_ns())
        if line is not None:
            log.info("%s", line)

    async def _sound(self) -> None:
        """Play the tone that is due."""
        async for _ in ticks(TickGrid(monotonic_ns(), ALARM_PERIOD_NS)):
            pipeline, signs = self._pipeline, {robot.name: robot.sign for robot in self._fleet}
            far, doubts = pipeline.beyond_reach.far, bool(pipeline.doubts)
            alarm = self._alarms.step(monotonic_ns(), signs, beyond_reach=far, doubts=doubts)
            if alarm is not None:
                self._player.play(alarm)

    def pause_alarms(self) -> None:
        """Silence what sounds now for a while; what begins meanwhile is heard."""
        log.info("alarms that are active now are silent for %g s", self._config.alarms.pause_s)
        self._alarms.pause(monotonic_ns(), self._config.alarms.pause_s)

    def _on_frame(self, bus: str, frame_id: int, data: bytes, now_ns: int) -> None:
        if self._switches.frame(bus, frame_id, data, now_ns):
            return
        if self._calls.frame(bus, frame_id, data, now_ns):
            angles = self._calls.close(now_ns)
            if angles is not None:
                self._send(angles)
            if self._tap is not None:
                self._tap.rest(now_ns)

    def _on_frames(self, bus: str, frames: list[tuple[int, bytes, int]]) -> None:
        """Frames of free-running nodes: the next tick reads them."""
        self._calls.frames(bus, frames)

    def _on_zero_pose_key(self, key: KeyState) -> None:
        if self._pressed.take(key.down, key.presses):
            self._calls.ask_zero_pose(key.name, monotonic_ns())

    def _on_bus(self, bus: str, up: bool) -> None:
        if not up:
            self._switches.bus_down(bus)
            self._calls.bus_down(bus)

    def _send_at_once(self, grip: Grip) -> None:
        """The operator let go: no robot waits for the next posture to hear of it."""
        if self._newest is not None:
            for _ in self._fleet.send(self._newest, grip, monotonic_ns()):
                pass

    def _send(self, angles: JointAngleSample) -> None:
        angles_ns = monotonic_ns()
        for line in self._pipeline.warnings:
            log.warning("%s", line)
        for line in self._pipeline.said:
            log.warning("%s", line, extra=BELL)
        self._newest, grip = angles, self._switches.take()
        for _ in self._fleet.send(angles, grip, angles_ns):
            done_ns = monotonic_ns()
            self._stages.record(
                angles.frames_in_ns - angles.sampled_ns, angles_ns - angles.frames_in_ns, done_ns - angles_ns
            )
            self._frames_in_to_put.record(done_ns - angles.frames_in_ns)
        for line in self._doubt_log.lines(self._pipeline.doubts, angles_ns):
            log.warning("%s", line)

    async def _publish_metrics(self) -> None:
        async for due in ticks(TickGrid(monotonic_ns(), round(1e9 / STATISTICS.rate_hz))):
            shared = self._shared_metrics()
            for robot in self._fleet:
                robot.publish_metrics(due.scheduled_ns, shared)
            for line in self._silence.lines(self._bus_signs(), due.scheduled_ns):
                log.warning("%s", line)
            away = [bus for bus in self._buses if not bus.up and bus.last_error]
            let_go = [
                f"{name}: {words}" for name, words in self._switches.words.items() if "held" not in words
            ]
            waiting = [f"waiting for bus {bus.name}: {bus.last_error}" for bus in away]
            self._notifier.status("; ".join([*waiting, *let_go, *(robot.standing for robot in self._fleet)]))

    def _bus_signs(self) -> dict[str, BusSigns]:
        poll = self._pipeline.poll
        return {
            bus.name: poll.signs(bus.name, bus.up, bus.counters)
            for bus in self._buses
            if bus.name in poll.buses_with_nodes
        }

    def _shared_metrics(self) -> MasterMetrics:
        watch = self._pipeline.estimator.heading_watch
        return MasterMetrics(
            software=software(),
            operator=self._config.operator.name,
            paths=self._session.paths,
            command_hz=self._rate.hz,
            command_rate=self._rate.words,
            heap=heap_in_use(),
            ticks=Ticks(self._ticks_expected, self._ticks_missed),
            stages_ms=self._stages.summary(),
            frames_in_to_put_ms=self._frames_in_to_put.summary(),
            nodes=self._pipeline.node_counts(),
            doubts=as_figures(self._pipeline.doubts),
            beyond_reach=self._pipeline.beyond_reach.metrics(),
            switches=self._switches.words,
            buses={bus.name: bus.metrics() for bus in self._buses},
            robots={},
            zero_pose_again=self._pipeline.zero_pose.metrics(),
            arm_load=dict(self._pipeline.arm_load.metrics()),
            headings_deg={} if watch is None else watch.figures_deg(),
        )

    def metrics(self) -> MasterMetrics:
        """Counters and percentiles of the whole process, for tables and reports."""
        return replace(self._shared_metrics(), robots={robot.name: robot.metrics() for robot in self._fleet})


async def run(config: MasterConfig, stop: asyncio.Event, write_metrics: WriteMetrics) -> None:
    """Run a master until `stop` is set. Raises BusError or LinkError when it cannot start."""
    await until_stopped(stop, _run(config, write_metrics))
    log.info("stopped")


async def _run(config: MasterConfig, write_metrics: WriteMetrics) -> None:
    notifier = open_notifier()
    enter_real_time(config.process.realtime_priority)  # first, so that every thread has it
    check_keys(config.link)
    check_operator(config.link, config.operator.name)
    audit = Audit(config.link)
    async with open_session(config.link, waits=notifier.waits) as session:
        audit.attach(session)
        tap = open_tap(config.tap, describe(config))
        master = Master(config, session, notifier, tap)
        where = ", ".join(config.link.connect or config.link.listen)
        session.declare_operator(config.operator.name, own_endpoints(config.link))
        robots = ", ".join(config.commanded + [f"watches {pattern}" for pattern in config.watched])
        log.info("%s: %d nodes polled, commands go to %s", robots, len(config.nodes), where)
        freeze_heap()  # now that all is built: a full collection took 80 ms
        reserve_heap()
        # not the main thread; or Windows, which has no such signal
        with suppress(ValueError, RuntimeError, AttributeError):
            asyncio.get_running_loop().add_signal_handler(signal.SIGUSR1, master.pause_alarms)
        try:
            await master.run()
        finally:
            notifier.stopping()
            if tap is not None:
                tap.close()
            write_metrics(replace(master.metrics(), access=audit.metrics()))
