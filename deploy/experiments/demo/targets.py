"""The limits that a demo is held to, for each profile of the robot."""

from __future__ import annotations

from deploy.measure.paper import ETA_PERCENT, TABLE_1
from deploy.measure.target import ReportTarget

_WHOLE_WAY = (
    ReportTarget("capture ticks missed", ("ticks", "missed"), 0),
    ReportTarget("master, of one core", ("cpu_percent", "master"), 35.0, "%"),
    ReportTarget("master, memory", ("rss_mb", "master"), 150.0, "MB"),
    ReportTarget("last frame in → put, p99", ("frames_in_to_put_ms", "p99"), 3.0, "ms"),
    ReportTarget("commands due that never came", ("commands", "missing"), 0),
    ReportTarget("motion lag", ("motion_lag_ms",), 25.0, "ms"),
    ReportTarget("same-instant RMSE / latest", ("rmse_over_latest",), 0.333),
    ReportTarget("roughness", ("motion", "roughness"), 2.5),
)
"""For every profile."""

DEMO = (
    *_WHOLE_WAY,
    ReportTarget("η (Eq. 25)", ("eta_percent",), ETA_PERCENT, "%"),
    *(
        ReportTarget(
            f"{joint.replace('_', ' ')}, mean error",
            ("table_1", f"*_{joint}", "error_deg"),
            row.error_deg,
            "°",
        )
        for joint, row in TABLE_1.items()
    ),
)
"""For the nursing robot."""

HAND = (
    *_WHOLE_WAY,
    ReportTarget("one way p99 + motion lag (paper B)", ("one_way_plus_lag_ms",), 60.0, "ms"),
    ReportTarget("finger joint's RMSE, the worst (paper B)", ("worst_joint", "rmse_deg"), 1.0, "°"),
    ReportTarget("finger joint's error, the largest (paper B)", ("worst_joint", "max_deg"), 2.0, "°"),
)
"""For the hand: half of what paper B allows its units against a reference unit, 1.5° and 3°."""

LOWER_LIMB = (
    *_WHOLE_WAY,
    ReportTarget("knee's RMSE (paper C)", ("accuracy", "*_knee_flexion", "rmse_deg"), 2.0, "°"),
)
"""For the legs."""

OWN = _WHOLE_WAY
"""For a robot of one's own."""

BY_PROFILE = {"nursing": DEMO, "hand": HAND, "lower_limb": LOWER_LIMB}

CANOPEN = (
    ReportTarget("robot, of one core", ("cpu_percent", "slave"), 25.0, "%"),
    ReportTarget("SYNC → all positions, p99", ("servos", "times_ms", "sync_to_positions", "p99"), 5.0, "ms"),
)
"""Also for every profile, with CANopen drives."""


def of_demo(profile: str, servos: str) -> tuple[ReportTarget, ...]:
    """The limits for a profile and its servo backend."""
    return BY_PROFILE.get(profile, OWN) + (CANOPEN if servos != "mujoco" else ())
