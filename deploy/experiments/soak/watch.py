"""What a soak makes of the messages it hears: a row of figures a second, and what changed."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping

import numpy as np

from common.clock import to_ms, to_ns
from common.errors import CodecError
from common.latency.one_way import master_offset, one_way_ns
from common.link import Link
from common.metrics.master import MasterMetrics
from common.metrics.parts import HeapMetrics, Summary
from common.metrics.slave import SlaveMetrics
from common.skeleton import Skeleton
from common.wire.codec import decode
from common.wire.messages import Command, RobotState, Statistics
from common.wire.topics import COMMAND, STATE, STATISTICS
from deploy.experiments.soak.counts import Additions
from deploy.experiments.soak.files.happenings import (
    BlindWayMeasured,
    GuardChanged,
    Happening,
    JointsUnknown,
    LeaseChanged,
)
from deploy.experiments.soak.motion import MotionWatch
from deploy.measure.blind import STANDS_S, blind_outages

FRESH_NS = to_ns(2.0 / COMMAND.rate_hz)
NEWEST = 110
"""States of some two seconds: an outage is judged from before its last command until the robot stands."""
Record = Callable[[Happening], None]
"""Takes what has happened."""


class Watch:
    """Keeps the newest of each message and the figures of the second that runs. Constant in memory."""

    def __init__(self, skeleton: Skeleton, record: Record) -> None:
        self._skeleton = skeleton
        self._record = record
        self._added = {role: Additions() for role in ("master", "slave")}
        self.motion = MotionWatch(skeleton)
        self.state: RobotState | None = None
        self.command: Command | None = None
        self.state_ns = 0
        """When the newest state arrived, own clock."""
        self.accepted_ns = 0
        """When a state last showed a newly accepted command."""
        self.held_ns = 0
        """When the guard was last seen to go from moving to hold."""
        self.engaged = 0
        """Engagements that the soak asked for, and was granted."""
        self.aligns = 0
        """Times that the guard was seen to begin to move."""
        self._echoed: tuple[int, int] = (0, 0)
        self._written: tuple[int, int] = (0, 0)
        self._one_way_ms: list[float] = []
        self._written_ms: list[float] = []
        self._age_max_ms = float("nan")
        self._row: dict[str, float] = {}
        self._invalid = -1
        self._newest: deque[RobotState] = deque(maxlen=NEWEST)
        self._blind_ns: int | None = None
        """When the robot went to hold, until its hands are seen to stand; slave's clock."""

    def listen(self, link: Link) -> None:
        """Hear a robot from now on."""
        link.subscribe(STATE, self.on_state)
        link.subscribe(COMMAND, self.on_command)
        link.subscribe(STATISTICS, self.on_statistics)

    def on_command(self, payload: bytes, _: int) -> None:
        """A command went by."""
        try:
            self.command = decode(payload, Command, len(self._skeleton.joints))
        except CodecError:
            self._add("undecodable", 1)
            return
        invalid = int((~self.command.valid).sum())
        if invalid != self._invalid:
            self._invalid = invalid
            self._record(JointsUnknown(invalid))

    def on_state(self, payload: bytes, arrived_ns: int) -> None:
        """A state of the robot arrived."""
        try:
            state = decode(payload, RobotState, len(self._skeleton.joints))
        except CodecError:
            self._add("undecodable", 1)
            return
        before, self.state, self.state_ns = self.state, state, arrived_ns
        if before is not None and state.sequence > before.sequence:
            self._add("states_missed", state.sequence - before.sequence - 1)
        self.motion.see(state)
        self._see_blind(state)
        if before is None or state.guard != before.guard:
            self._on_guard("" if before is None else before.guard, state, arrived_ns)
        if before is None or state.lease_id != before.lease_id:
            self._record(LeaseChanged(state.operator, state.lease_id))
        self._on_echo(state, arrived_ns)

    def _see_blind(self, state: RobotState) -> None:
        """Once the hands stand after a hold: how far they went, and what had been foretold."""
        if self._newest and state.guard == "hold" and self._newest[-1].guard in ("align", "track"):
            self._blind_ns = state.encoder_ns
        self._newest.append(state)
        if self._blind_ns is not None and state.encoder_ns - self._blind_ns > to_ns(STANDS_S):
            self._blind_ns = None
            for one in blind_outages(list(self._newest), self._skeleton):
                self._record(BlindWayMeasured(one.hand, 100.0 * one.foretold_m, 100.0 * one.measured_m))

    def _on_guard(self, before: str, state: RobotState, arrived_ns: int) -> None:
        if before in ("align", "track") and state.guard == "hold":
            self.held_ns = arrived_ns
        if state.guard == "align" or (state.guard == "track" and before != "align"):
            self.aligns += 1
        self._record(GuardChanged(before, state.guard, state.reason))

    def _on_echo(self, state: RobotState, arrived_ns: int) -> None:
        echo = state.echo
        if echo is None:
            return
        this, offset = (echo.sequence, echo.put_ns), master_offset(state)
        written_ns = one_way_ns(echo.put_ns, echo.written_ns, offset)
        # one state may show that a command was accepted, and only the next that it was written
        if written_ns is not None and echo.written_ns and this != self._written:
            self._written = this
            self._written_ms.append(to_ms(written_ns))
        if this == self._echoed:
            return
        self._echoed = this
        self.accepted_ns = arrived_ns
        transit_ns = one_way_ns(echo.put_ns, echo.received_ns, offset)
        accepted_ns = one_way_ns(echo.put_ns, echo.accepted_ns, offset)
        if transit_ns is not None and accepted_ns is not None:
            self._one_way_ms.append(to_ms(transit_ns))
            self._age_max_ms = np.fmax(self._age_max_ms, to_ms(accepted_ns))
            self._row["offset_bound_ms"] = to_ms(offset.bound_ns)

    def on_statistics(self, payload: bytes, _: int) -> None:
        """Statistics of a process arrived."""
        try:
            statistics = decode(payload, Statistics)
        except CodecError:
            self._add("undecodable", 1)
            return
        if isinstance(statistics.metrics, MasterMetrics):
            self._on_master(statistics.metrics)
        else:
            self._on_slave(statistics.metrics)

    def _on_master(self, metrics: MasterMetrics) -> None:
        self._on_heap("master", metrics.heap)
        # a message holds the metrics of the robot that it is sent to, and of no other
        (robot,) = metrics.robots.values()
        counters = {
            "sent": robot.commands_sent,
            "master_ticks": metrics.ticks.expected,
            "master_missed": metrics.ticks.missed,
            "times_lost": robot.robot.times_lost,
        }
        self._count("master", counters)
        self._mean("master", "round_trip", robot.round_trip_ms)

    def _on_heap(self, role: str, heap: HeapMetrics) -> None:
        self._row[f"{role}_blocks"] = float(heap.python_blocks)
        if heap.bytes_in_use is not None:
            self._row[f"{role}_in_use_mb"] = heap.bytes_in_use / 1e6

    def _on_slave(self, metrics: SlaveMetrics) -> None:
        self._on_heap("slave", metrics.heap)
        commands = metrics.commands
        counters = {
            # one that comes after all is late and not lost any more: only the two together never shrink
            "missing": commands.lost + commands.late,
            "arrived": commands.arrived,
            "late": commands.late,
            "repeated": commands.repeated,
            "overwritten": metrics.link[COMMAND.name].overwritten,
            "due": metrics.due.expected,
            # a command that came late was not there when it was due, but has its own column
            "gone": metrics.due.missing,
            "slave_ticks": metrics.ticks.expected,
            "slave_missed": metrics.ticks.missed,
            # while nobody holds the lease every command is refused, and nothing is wrong with that
            "refused": sum(count for gate, count in metrics.guard.dropped.items() if gate != "lease"),
        }
        added = {name: self._added["slave"].take(name, value) for name, value in counters.items()}
        added["lost"] = added.pop("missing") - added["late"]
        added["gone"] -= added["late"]
        for name, count in added.items():
            self._add(name, count)
        self._mean("slave", "end_to_end", metrics.end_to_end_ms)

    def restarted(self, role: str) -> None:
        """A process begins anew: so do its counters, and a robot within it stands elsewhere."""
        if role in self._added:
            self._added[role] = Additions()
        if role == "slave":
            self.motion.forget()

    def _count(self, role: str, counters: Mapping[str, float]) -> None:
        for name, value in counters.items():
            self._add(name, self._added[role].take(name, value))

    def _add(self, name: str, count: float) -> None:
        self._row[name] = self._row.get(name, 0.0) + count

    def _mean(self, role: str, name: str, summary: Summary) -> None:
        count, mean = self._added[role].mean(name, summary)
        self._add(f"{name}_n", count)
        if count:
            self._row[f"{name}_ms"] = mean

    def row(self) -> dict[str, float | str]:
        """The figures since the last call; then they begin anew."""
        row: dict[str, float | str] = {"guard": self.state.guard if self.state else "", **self._row}
        row["one_way_n"] = float(len(self._one_way_ms))
        if self._one_way_ms:
            row["one_way_p50_ms"] = float(np.median(self._one_way_ms))
            row["one_way_max_ms"] = max(self._one_way_ms)
            row["age_max_ms"] = float(self._age_max_ms)
        if self._written_ms:
            row["written_p50_ms"] = float(np.median(self._written_ms))
        self._row, self._one_way_ms, self._written_ms = {}, [], []
        self._age_max_ms = float("nan")
        return row

    # the moment

    def heard(self, now_ns: int) -> bool:
        """Whether the robot was heard lately."""
        return self.state is not None and now_ns - self.state_ns < to_ns(STATE.timeout_s) * 2

    def guard(self, now_ns: int) -> str:
        """The guard's state, or that the robot is silent."""
        return self.state.guard if self.state is not None and self.heard(now_ns) else "silent"

    def flows(self, now_ns: int, since_ns: int = 0) -> bool:
        """Whether the robot accepts commands, and has done so since a moment."""
        return self.accepted_ns > since_ns and now_ns - self.accepted_ns < FRESH_NS and self.heard(now_ns)

    def known(self) -> bool:
        """Whether the master knows every joint of the operator."""
        return self.command is not None and bool(self.command.valid.all())
