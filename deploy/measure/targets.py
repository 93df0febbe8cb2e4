"""The figures to reach, as data: where each stands in a report, and how far it may go."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from deploy.measure.accuracy import SIDES
from deploy.measure.paper import ETA_PERCENT, TABLE_1


@dataclass(frozen=True, slots=True)
class Target:
    """One figure and the most it may be."""

    name: str
    path: tuple[str, ...]
    """Keys from the top of the report to the value; `*` in a key stands for each side, the worse counts."""
    limit: float
    unit: str = ""


@dataclass(frozen=True, slots=True)
class Verdict:
    """A target beside what was measured; `value` is None where the report does not hold it."""

    target: Target
    value: float | None

    @property
    def met(self) -> bool | None:
        """None where there is nothing to judge."""
        return None if self.value is None else self.value <= self.target.limit


_WHOLE_WAY = (
    Target("capture ticks missed", ("ticks", "missed"), 0),
    Target("master, of one core", ("cpu_percent", "master"), 35.0, "%"),
    Target("master, memory", ("rss_mb", "master"), 150.0, "MB"),
    Target("last frame in → put, p99", ("frames_in_to_put_ms", "p99"), 3.0, "ms"),
    Target("commands due that never came", ("commands", "missing"), 0),
    Target("motion lag", ("motion_lag_ms",), 25.0, "ms"),
    Target("same-instant RMSE / hold's", ("rmse_over_hold",), 0.333),
    Target("roughness", ("motion", "roughness"), 2.5),
)
"""What any profile's demo is held against."""

DEMO = (
    *_WHOLE_WAY,
    Target("η (Eq. 25)", ("eta_percent",), ETA_PERCENT, "%"),
    *(
        Target(
            f"{joint.replace('_', ' ')}, mean error",
            ("table_1", f"*_{joint}", "error_deg"),
            row.error_deg,
            "°",
        )
        for joint, row in TABLE_1.items()
    ),
)
"""What a report of `tandem demo` is held against, with the nursing robot."""

HAND = (
    *_WHOLE_WAY,
    Target("one way p99 + motion lag (paper B)", ("one_way_plus_lag_ms",), 60.0, "ms"),
    Target("finger joint's RMSE, the worst (paper B)", ("worst_joint", "rmse_deg"), 1.0, "°"),
    Target("finger joint's error, the largest (paper B)", ("worst_joint", "max_deg"), 2.0, "°"),
)
"""The same with the hand: half of what paper B allows its units against a reference unit, 1.5° and 3°."""

LOWER_LIMB = (
    *_WHOLE_WAY,
    Target("knee's RMSE (paper C)", ("accuracy", "*_knee_flexion", "rmse_deg"), 2.0, "°"),
)
"""The same with the legs."""

BY_PROFILE = {"nursing": DEMO, "hand": HAND, "lower_limb": LOWER_LIMB}

CANOPEN = (
    Target("robot, of one core", ("cpu_percent", "slave"), 25.0, "%"),
    Target("SYNC → all positions, p99", ("servos", "times_ms", "sync_to_positions", "p99"), 5.0, "ms"),
)
"""What any profile's demo with CANopen drives is held against as well."""


def of_demo(profile: str, servos: str) -> tuple[Target, ...]:
    """What a demo is held against."""
    return BY_PROFILE[profile] + (CANOPEN if servos == "canopen" else ())


BENCH = (
    Target("fuse + filter, 36 nodes", ("pipeline", "nodes_36", "fuse_us", "median"), 200.0, "µs"),
    Target("the same with ekf", ("pipeline", "nodes_36_ekf", "fuse_us", "median"), 400.0, "µs"),
    Target("solve 25 joints", ("pipeline", "solve_us", "median"), 150.0, "µs"),
    Target("encode + decode a command", ("pipeline", "codec_us", "median"), 15.0, "µs"),
    Target("put → received / bare Zenoh", ("link", "over_bare_zenoh"), 1.5),
    Target("the same over tcp, p99", ("transports", "tcp_p99_over_bare_zenoh"), 2.0),
    Target("tls, quic, quic-datagram / tcp, the worst", ("transports", "worst_secure_over_tcp"), 2.0),
    Target("master, of one core", ("core_percent", "master_36_nodes"), 35.0, "%"),
)
"""What a report of `tandem bench` is held against."""


def verdicts(report: Mapping[str, object], targets: Iterable[Target]) -> list[Verdict]:
    """Each target beside the report's value."""
    return [Verdict(target, _worst(report, target.path)) for target in targets]


def _worst(report: object, path: tuple[str, ...]) -> float | None:
    """The worse side's. A side that is in the report and has no figure leaves nothing to judge."""
    found = [_value(report, tuple(key.replace("*", side) for key in path)) for side in SIDES]
    if None in found:
        return None
    return max((value for value in found if isinstance(value, float)), default=None)


class _Absent:
    """Of a side that the robot does not have."""


def _value(report: object, path: tuple[str, ...]) -> float | _Absent | None:
    for i, key in enumerate(path):
        if not isinstance(report, Mapping):
            return None
        if key not in report and i and key.startswith(SIDES):
            return _ABSENT
        report = report.get(key)
    return float(report) if isinstance(report, int | float) and not isinstance(report, bool) else None


_ABSENT = _Absent()
