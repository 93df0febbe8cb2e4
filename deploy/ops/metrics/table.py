"""The one table of metrics: name, type, meaning, labels, where the value comes from, how it is drawn. Pure.

Names and units follow Prometheus: base units, seconds, `_total` for counters. What is served, the dashboard
and the alerts are all made from this table.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from enum import StrEnum

from common.clock import to_s
from common.metrics.master import MasterMetrics
from common.metrics.parts import Summary
from common.metrics.slave import CameraMetrics, SlaveMetrics

GUARD_STATES = ("boot", "hold", "align", "track", "clutch", "estop")
FRESH_S = 5.0
"""Statistics come once a second; older ones are not served, so that a dead process has no values."""


class MetricType(StrEnum):
    """As Prometheus names them."""

    GAUGE = "gauge"
    COUNTER = "counter"
    SUMMARY = "summary"


@dataclass(frozen=True, slots=True)
class HeardStatistics:
    """The newest statistics of one process about one robot."""

    robot: str
    role: str
    """master or slave."""
    metrics: MasterMetrics | SlaveMetrics
    heard_ns: int
    """This host's monotonic clock."""

    @property
    def operator(self) -> str:
        """Whose master it is; empty for a slave."""
        return self.metrics.operator if isinstance(self.metrics, MasterMetrics) else ""

    @property
    def labels(self) -> dict[str, str]:
        """Of the process, whatever the robot is: two masters may speak to one robot."""
        return (
            {"role": self.role, "operator": self.operator} if self.role == "master" else {"role": self.role}
        )


@dataclass(frozen=True, slots=True)
class ServedSample:
    """One value; labels beyond `robot` and `role`."""

    value: float | Summary
    labels: Mapping[str, str]


Take = Callable[[MasterMetrics | SlaveMetrics], Iterable[ServedSample]]


@dataclass(frozen=True, slots=True)
class ServedMetric:
    """One row of the table."""

    name: str
    """Without `_total`."""
    type: MetricType
    help: str
    take: Take
    labels: tuple[str, ...] = ()
    unit: str = "short"
    """As Grafana names it."""
    drawn: str = ""
    """PromQL of its panel, with {name} for the full name; empty: it has none."""
    by_robot: bool = True
    """False: of the process. A master sends each robot the same, so its figures have no label `robot`."""

    @property
    def full_name(self) -> str:
        """As it is scraped."""
        return f"{self.name}_total" if self.type is MetricType.COUNTER else self.name


def _slave(take: Callable[[SlaveMetrics], Iterable[ServedSample]]) -> Take:
    return lambda metrics: take(metrics) if isinstance(metrics, SlaveMetrics) else ()


def _master(take: Callable[[MasterMetrics], Iterable[ServedSample]]) -> Take:
    return lambda metrics: take(metrics) if isinstance(metrics, MasterMetrics) else ()


def _one(value: float | None) -> Iterable[ServedSample]:
    return () if value is None else (ServedSample(float(value), {}),)


def _each(label: str, values: Mapping[str, float | Summary]) -> Iterable[ServedSample]:
    return [ServedSample(value, {label: name}) for name, value in values.items()]


def _cameras(metrics: SlaveMetrics) -> Mapping[str, CameraMetrics]:
    """By name; the main one's is empty, which Prometheus takes for no label: as where it is the only one."""
    main = {} if metrics.video is None else {"": metrics.video}
    return {**main, **metrics.other_videos}


def _stages(metrics: MasterMetrics | SlaveMetrics) -> Iterable[ServedSample]:
    stages = dict(metrics.stages_ms)
    if isinstance(metrics, SlaveMetrics):
        stages |= {"one way": metrics.one_way_ms, "end to end": metrics.end_to_end_ms}
        stages["one way with missing"] = metrics.one_way_corrected_ms
    else:
        for robot in metrics.robots.values():
            stages["round trip"] = robot.round_trip_ms
    return _each("stage", stages)


def _robots(metrics: MasterMetrics, value: Callable[[str], float]) -> Iterable[ServedSample]:
    """A message to a robot holds that robot alone."""
    return [ServedSample(value(name), {}) for name in metrics.robots]


def _buses(metrics: MasterMetrics | SlaveMetrics) -> Iterable[ServedSample]:
    buses = metrics.buses if isinstance(metrics, MasterMetrics) else metrics.servos.buses
    return _each("bus", {name: float(bus.up) for name, bus in buses.items()})


_G, _C, _S = MetricType.GAUGE, MetricType.COUNTER, MetricType.SUMMARY
TABLE: tuple[ServedMetric, ...] = (
    ServedMetric(
        "tandem_latency_seconds", _S, "Duration of each stage since the start: median, 99th percentile.",
        _stages, ("stage",), "s", '{name}{{quantile="0.99"}}',
    ),
    ServedMetric(
        "tandem_one_way_bound_seconds", _G, "Largest error of one-way latencies by the clock offset.",
        _slave(lambda m: _one(m.offset.bound_ms / 1e3 if m.offset.trusted else None)), (), "s", "{name}",
    ),
    ServedMetric(
        "tandem_clock_offset_trusted", _G, "1 while the offset between the two hosts' clocks is known.",
        _slave(lambda m: _one(float(m.offset.trusted))), (), "bool_yes_no",
    ),
    ServedMetric(
        "tandem_guard_state", _G, "1 for the state that the robot's guard is in, 0 for the others.",
        _slave(lambda m: _each("state", {s: float(m.guard.state == s) for s in GUARD_STATES})), ("state",),
        "short", "{name} == 1",
    ),
    ServedMetric(
        "tandem_holds", _C, "Times that the robot stopped following, by what was lost.",
        _slave(lambda m: _each("lost", dict(m.guard.losses))), ("lost",), "short",
        "increase({name}[5m])",
    ),
    ServedMetric(
        "tandem_clamps", _C, "Limits that began to hold a joint back, by rule.",
        _slave(lambda m: _each("rule", dict(m.guard.clamps))), ("rule",), "short", "rate({name}[1m])",
    ),
    ServedMetric(
        "tandem_commands_accepted", _C, "Commands that passed the guard's gates.",
        _slave(lambda m: _one(m.guard.accepted)), (), "cps", "rate({name}[1m])",
    ),
    ServedMetric(
        "tandem_commands_dropped", _C, "Commands that a gate of the guard refused.",
        _slave(lambda m: _each("gate", dict(m.guard.dropped))), ("gate",), "cps", "rate({name}[1m])",
    ),
    ServedMetric(
        "tandem_commands_missing", _C, "Commands that were not there when they were due.",
        _slave(lambda m: _one(m.due.missing)), (), "cps", "rate({name}[1m])",
    ),
    ServedMetric(
        "tandem_joints_doubted", _C, "Times that a joint was held because its encoder was not believed.",
        _slave(lambda m: _each("joint", dict(m.guard.doubts))), ("joint",),
    ),
    ServedMetric(
        "tandem_joint_without_effort", _G, "1 for a joint without effort: no contact is noticed there.",
        _slave(lambda m: _each("joint", dict.fromkeys(m.servos.no_effort, 1.0))), ("joint",),
    ),
    ServedMetric(
        "tandem_servo_events", _C, "What the servo backend counts, by its own names.",
        _slave(lambda m: _each("event", dict(m.servos.counters))), ("event",),
    ),
    ServedMetric(
        "tandem_video_pictures_per_second", _G, "Pictures that a camera of the robot sends.",
        _slave(lambda m: _each("camera", {name: one.fps for name, one in _cameras(m).items()})),
        ("camera",), "fps", "{name}",
    ),
    ServedMetric(
        "tandem_video_failed", _G, "1 while a camera of the robot gives no picture.",
        _slave(lambda m: _each("camera", {n: float(bool(one.fault)) for n, one in _cameras(m).items()})),
        ("camera",), "bool_yes_no",
    ),
    ServedMetric(
        "tandem_robot_silent", _G, "1 while the master does not hear the robot.",
        _master(lambda m: _robots(m, lambda name: float(m.robots[name].robot.silent))), (), "bool_yes_no",
    ),
    ServedMetric(
        "tandem_lease_held", _G, "1 while the master may command the robot.",
        _master(lambda m: _robots(m, lambda name: float(m.robots[name].lease.held))), (), "bool_yes_no",
    ),
    ServedMetric(
        "tandem_commands_sent", _C, "Commands that the master sent.",
        _master(lambda m: _robots(m, lambda name: m.robots[name].commands_sent)), (), "cps",
        "rate({name}[1m])",
    ),
    ServedMetric(
        "tandem_command_rate_hertz", _G, "Commands a second in force.",
        _master(lambda m: _one(m.command_hz)), (), "hertz",
    ),
    ServedMetric(
        "tandem_command_rate_falls", _C, "Times that loss or jitter made a robot ask for the usual rate.",
        _slave(lambda m: _one(None if m.rate is None else m.rate.falls)), (), "short", "increase({name}[5m])",
    ),
    ServedMetric(
        "tandem_node_windows", _C, "Ticks of each worn node by what came of them: fresh, late, lost, …",
        _master(
            lambda m: [
                ServedSample(float(count), {"node": node, "event": event})
                for node, counts in m.nodes.items()
                for event, count in counts.items()
            ]
        ),
        ("node", "event"), "cps", 'rate({name}{{event!="fresh"}}[1m])', by_robot=False,
    ),
    ServedMetric(
        "tandem_node_doubted", _G, "1 for a node whose readings are not believed.",
        _master(lambda m: _each("node", dict.fromkeys(m.doubts, 1.0))), ("node",), by_robot=False,
    ),
    ServedMetric(
        "tandem_bus_up", _G, "1 while a CAN bus works.",
        _buses,
        ("bus",), "bool_yes_no", by_robot=False,
    ),
    ServedMetric(
        "tandem_ticks", _C, "Turns of the process's loop that were due.", lambda m: _one(m.ticks.expected),
        (), "cps", by_robot=False,
    ),
    ServedMetric(
        "tandem_ticks_missed", _C, "Turns of the process's loop that came too late and were left out.",
        lambda m: _one(m.ticks.missed), (), "cps", "rate({name}[1m])", by_robot=False,
    ),
    ServedMetric(
        "tandem_heap_bytes", _G, "Memory in use by C code.", lambda m: _one(m.heap.bytes_in_use), (), "bytes",
        "{name}", by_robot=False,
    ),
)  # fmt: skip
UP = "tandem_up"
"""1 for a process that was heard within 5 s, else 0: each robot's slave, and a master that was ever heard."""
RECORDING_AGE, RECORDING_FREE = "tandem_recording_age_seconds", "tandem_recording_free_bytes"
"""With --recordings: time since the newest recording was written to, +Inf without one; room on its disk."""
ONE_WAY = "tandem_one_way_seconds"
BUCKETS_S = (0.005, 0.01, 0.02, 0.035, 0.05, 0.075, 0.1, 0.15, 0.2, 0.3, 0.5, 1.0, float("inf"))
"""Upper edges. The alert's limit is among them, so that it is not interpolated."""
BESIDE = {
    ONE_WAY: "From put to received; of a command that did not come, how long the robot went without it.",
    UP: "1 while a process's statistics come.",
    RECORDING_AGE: "Time since the newest recording in the folder was written to; +Inf without one.",
    RECORDING_FREE: "Room on the disk of the recordings.",
}


def is_fresh(heard: HeardStatistics, now_ns: int) -> bool:
    """Whether the process still speaks."""
    return to_s(now_ns - heard.heard_ns) <= FRESH_S


def served_names() -> frozenset[str]:
    """Every name that can be scraped, with the parts of summaries."""
    names = {metric.full_name for metric in TABLE} | set(BESIDE)
    for metric in TABLE:
        if metric.type is MetricType.SUMMARY:
            names |= {f"{metric.name}_count", f"{metric.name}_sum"}
    names |= {f"{ONE_WAY}_{part}" for part in ("bucket", "count", "sum")}
    return frozenset(names)
