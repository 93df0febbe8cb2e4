"""The master's process: real buses, the real link and a real clock around the pure pipeline."""

from __future__ import annotations

import asyncio
import logging
import secrets
from collections.abc import Callable

from common.can.bus import CanBus
from common.clock import monotonic_ns, to_ns
from common.codec import decode, encode
from common.errors import CodecError, LinkError
from common.latency import Durations, StageTimes
from common.launch import WriteFigures
from common.link import Link, open_link
from common.messages import ClockReply, ControlReply, RobotState, Statistics
from common.offset import MasterExchange
from common.pacing import TickGrid
from common.realtime import take_priority
from common.runtime import freeze_heap, until_stopped
from common.ticker import ticks
from common.topics import CLOCK, COMMAND, CONTROL, STATE, STATISTICS
from master.config import MasterConfig
from master.lease import LeaseKeeper
from master.pipeline import CommandWriter, MasterPipeline, Solved
from master.robot_watch import RobotWatch
from master.suit.protocol import SuitProtocol

log = logging.getLogger("tandem.master")


class Master:
    """One operator's capture loop and the sending of its commands to one robot."""

    def __init__(self, config: MasterConfig, link: Link) -> None:
        self._config = config
        self._link = link
        self._pipeline = MasterPipeline(config, SuitProtocol.load(config.capture.dbc))
        self._writer = CommandWriter(config.robot)
        asker = 1 + secrets.randbelow((1 << 63) - 1)
        self._clock = MasterExchange(asker)
        self._lease = LeaseKeeper(config.robot, config.operator.name, asker)
        self._robot = RobotWatch(config.operator.name)
        self._stages = StageTimes("sampled→frames in", "frames in→solved", "solved→put")
        self._frames_in_to_put = Durations()
        self._ticks_expected = 0
        self._ticks_missed = 0
        self._undecodable = 0
        self._buses = [CanBus(bus, self._on_frame, self._on_bus) for bus in config.capture.buses]
        self._put_command: Callable[[bytes], None] = link.publish(COMMAND)
        self._put_statistics: Callable[[bytes], None] = link.publish(STATISTICS)
        link.subscribe(STATE, self._on_state)

    async def run(self) -> None:
        """Capture, send, keep the lease and the clock until cancelled."""
        self._link.declare_alive("master")
        try:
            for bus in self._buses:
                bus.open()
            async with asyncio.TaskGroup() as tasks:
                tasks.create_task(self._capture())
                tasks.create_task(self._keep_lease())
                tasks.create_task(self._keep_clock())
                tasks.create_task(self._tell())
        finally:
            for bus in self._buses:
                await bus.close()

    async def _capture(self) -> None:
        period_ns = round(1e9 / self._config.capture.rate_hz)
        async for due in ticks(TickGrid(monotonic_ns() + period_ns, period_ns)):
            self._ticks_expected += 1 + due.missed
            self._ticks_missed += due.missed
            for bus in self._buses:
                bus.read()  # answers that are here already are not late, however late this tick runs
            sync, late = self._pipeline.tick(due.tick, monotonic_ns())
            for bus in self._buses:
                bus.send(sync)
            if late is not None:
                self._send(late)

    def _on_frame(self, bus: str, frame_id: int, data: bytes, now_ns: int) -> None:
        if self._pipeline.frame(bus, frame_id, data, now_ns):
            solved = self._pipeline.close(now_ns)
            if solved is not None:
                self._send(solved)

    def _on_bus(self, bus: str, up: bool) -> None:
        if not up:
            self._pipeline.bus_down(bus)

    def _send(self, solved: Solved) -> None:
        solved_ns = monotonic_ns()
        held = self._config.operator.deadman == "always_held"
        put_ns = monotonic_ns()
        self._put_command(encode(self._writer.write(solved, self._lease.token, held, solved_ns, put_ns)))
        done_ns = monotonic_ns()
        self._stages.record(
            solved.frames_in_ns - solved.sampled_ns, solved_ns - solved.frames_in_ns, done_ns - solved_ns
        )
        self._frames_in_to_put.record(done_ns - solved.frames_in_ns)

    def _on_state(self, payload: bytes, arrived_ns: int) -> None:
        try:
            state = decode(payload, RobotState, len(self._pipeline.skeleton.joints))
        except CodecError:
            self._undecodable += 1
            return
        self._robot.on_state(state, arrived_ns)
        self._lease.on_state(state, arrived_ns)

    async def _keep_lease(self) -> None:
        async for due in ticks(TickGrid(monotonic_ns(), to_ns(0.05))):
            change = self._robot.change(due.scheduled_ns)
            if change:
                log.warning("%s: %s", self._config.robot, change)
            request = self._lease.request(monotonic_ns())
            if request is None or self._robot.silent(monotonic_ns()):
                continue
            try:
                reply = decode(await self._link.ask(CONTROL, encode(request)), ControlReply)
            except (LinkError, CodecError) as error:
                log.info("claim: %s", error)
                continue
            self._lease.on_reply(reply, monotonic_ns())
            log.info("claim: %s", reply.text)

    async def _keep_clock(self) -> None:
        async for _ in ticks(TickGrid(monotonic_ns(), round(1e9 / CLOCK.rate_hz))):
            query = self._clock.query(monotonic_ns())
            try:
                payload, arrived_ns = await self._link.ask_stamped(CLOCK, encode(query))
                self._clock.on_reply(decode(payload, ClockReply), arrived_ns)
            except (LinkError, CodecError):
                continue

    async def _tell(self) -> None:
        async for due in ticks(TickGrid(monotonic_ns(), round(1e9 / STATISTICS.rate_hz))):
            self._put_statistics(encode(Statistics("master", due.scheduled_ns, self.figures())))

    def figures(self) -> dict[str, object]:
        """Counters and percentiles for tables and reports."""
        return {
            "ticks": {"expected": self._ticks_expected, "missed": self._ticks_missed},
            "commands_sent": self._writer.sent,
            "stages_ms": self._stages.summary(),
            "frames_in_to_put_ms": self._frames_in_to_put.summary(),
            "round_trip_ms": self._robot.round_trip.summary(),
            "robot": {
                "silent": self._robot.silent(monotonic_ns()),
                "times_lost": self._robot.times_lost,
                "undecodable": self._undecodable,
            },
            "lease": {"held": bool(self._lease.token), "answer": self._lease.answer},
            "nodes": self._pipeline.node_counts(),
            "buses": {bus.name: bus.summary() for bus in self._buses},
            "link": self._link.counters(),
        }


async def run(config: MasterConfig, stop: asyncio.Event, write_figures: WriteFigures) -> None:
    """Run a master until `stop` is set. Raises BusError or LinkError when it cannot start."""
    take_priority(config.process)  # first, so that every thread has it
    async with open_link(config.link, config.robot) as link:
        master = Master(config, link)
        where = ", ".join(config.link.connect or config.link.listen)
        log.info("%s: %d nodes polled, commands go to %s", config.robot, len(config.nodes), where)
        freeze_heap()  # now that all is built: a full collection took 80 ms
        try:
            await until_stopped(stop, master.run())
        finally:
            write_figures(master.figures())
    log.info("stopped")
