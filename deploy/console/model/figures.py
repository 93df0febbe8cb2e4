"""What both sides publish of themselves once a second, as the page shows it. Pure."""

from __future__ import annotations

from collections.abc import Mapping

from common.clock import NS_PER_S
from common.metrics.master import MasterMetrics
from common.metrics.parts import Summary
from common.metrics.slave import SlaveMetrics
from common.metrics.tree import to_tree
from deploy.client.shift import shift_lines
from deploy.console.model.events import EventList
from deploy.console.model.nodes import NodeWatch

SILENT_NS = 3 * NS_PER_S
"""Older figures are not shown."""
AGAIN_NS = 10 * NS_PER_S
"""A limit that is met again within this is no new event."""
GOOD_PERCENT, FAIR_PERCENT = 1.0, 5.0
"""Up to so many commands missing the link is good, or fair."""


class RobotFigures:
    """Keeps the newest figures of master and robot, and says what grew since the ones before."""

    def __init__(self, nodes: NodeWatch, events: EventList) -> None:
        self._nodes = nodes
        self._events = events
        self._master: MasterMetrics | None = None
        self._master_ns = 0
        self._robot: SlaveMetrics | None = None
        self._robot_ns = 0
        self._clamped_ns: dict[str, int] = {}
        """By rule, when a limit was met last."""
        self._missing_percent: float | None = None
        self._lost_percent: float | None = None

    def on_master(self, metrics: MasterMetrics, now_ns: int) -> None:
        """Take the master's figures."""
        self._master, self._master_ns = metrics, now_ns
        for line in self._nodes.on_counters(metrics.nodes, metrics.doubts):
            self._events.add("node", line, now_ns)

    def on_robot(self, metrics: SlaveMetrics, now_ns: int) -> None:
        """Take the robot's figures."""
        before, self._robot, self._robot_ns = self._robot, metrics, now_ns
        if before is None or before.instance != metrics.instance:
            self._missing_percent = self._lost_percent = None
            return
        for rule in _grown(before.guard.clamps, metrics.guard.clamps):
            if now_ns - self._clamped_ns.get(rule, -AGAIN_NS) >= AGAIN_NS:
                self._events.add("clamp", f"the motion is limited: {rule}", now_ns)
            self._clamped_ns[rule] = now_ns
        for what, count in _grown(before.guard.losses, metrics.guard.losses).items():
            self._events.add("loss", f"lost: {what}" + f", {count} times" * (count > 1), now_ns)
        due = metrics.due.expected - before.due.expected
        self._missing_percent = 100.0 * (metrics.due.missing - before.due.missing) / due if due > 0 else None
        arrived = metrics.commands.arrived - before.commands.arrived
        lost = metrics.commands.lost - before.commands.lost
        self._lost_percent = 100.0 * lost / (arrived + lost) if arrived + lost > 0 else None

    @property
    def has_camera(self) -> bool:
        """Whether the robot says that it has a camera."""
        return self._robot is not None and self._robot.video is not None

    def stages(self, now_ns: int) -> list[dict[str, object]]:
        """The latency budget: the master's own stages are those of the robot's table where there are any."""
        summaries: Mapping[str, Summary] = {}
        if self._robot is not None and now_ns - self._robot_ns <= SILENT_NS:
            summaries = self._robot.stages_ms
        if not summaries and self._master is not None and now_ns - self._master_ns <= SILENT_NS:
            summaries = self._master.stages_ms
        return [
            {
                "name": name,
                "mean_ms": _short(one.mean),
                "p99_ms": _short(one.p99),
                "bound_ms": _short(one.bound),
            }
            for name, one in summaries.items()
        ]

    def shown(self, now_ns: int) -> dict[str, object]:
        """As the page has them."""
        master = self._master if now_ns - self._master_ns <= SILENT_NS else None
        robot = self._robot if now_ns - self._robot_ns <= SILENT_NS else None
        if master is None:
            self._nodes.forget()
        video = None if robot is None else robot.video
        return {
            "link": self._link(robot),
            "nodes": self._nodes.shown(),
            "shift": list(shift_lines(master)),
            "switches": {} if master is None else master.switches,
            "drives": {} if robot is None else _drives(robot),
            "lenses": {} if robot is None else {name: to_tree(one) for name, one in robot.lenses.items()},
            "camera": None
            if video is None
            else {"fps": round(video.fps, 1), "kb_s": round(video.kb_s, 1), "fault": video.fault},
            "versions": {
                "master": None if master is None else master.software.tandem,
                "robot": None if robot is None else robot.software.tandem,
            },
        }

    def _link(self, robot: SlaveMetrics | None) -> dict[str, object]:
        if robot is None:
            return {"word": "unknown", "why": "the robot's figures are not heard"}
        times = robot.times
        jitter = None if times is None or times.jitter_s is None else round(1e3 * times.jitter_s, 2)
        beyond = "" if times is None else times.beyond
        missing = self._missing_percent
        if beyond:
            word = "poor"
        elif missing is None:
            word = "unknown"
        else:
            word = "good" if missing < GOOD_PERCENT else "fair" if missing < FAIR_PERCENT else "poor"
        return {
            "word": word,
            "lost_percent": _short(self._lost_percent),
            "missing_percent": _short(missing),
            "jitter_ms": jitter,
            "why": beyond,
            "needs": "" if times is None else times.words,
        }


def _drives(robot: SlaveMetrics) -> dict[str, object]:
    servos = robot.servos
    return {
        "counters": servos.counters,
        "no_effort": servos.no_effort,
        "unlimited": servos.unlimited,
        "not_driven": servos.not_driven,
        "left_out": servos.left_out,
    }


def _grown(before: Mapping[str, int], now: Mapping[str, int]) -> dict[str, int]:
    each = {name: count - before.get(name, 0) for name, count in now.items()}
    return {name: count for name, count in each.items() if count > 0}


def _short(value: float | None) -> float | None:
    return None if value is None else round(value, 2)
