"""What a master and a robot publish in tests: whole metrics, of which a test changes what it is about."""

from __future__ import annotations

from typing import Any

from common.metrics.link import TopicCounters
from common.metrics.master import CommandedMetrics, LeaseHeld, MasterMetrics, RobotHeard, VideoReceived
from common.metrics.parts import HeapMetrics, Software, Summary, Ticks
from common.metrics.slave import (
    ArrivalCounts,
    DueMetrics,
    GuardMetrics,
    OffsetMetrics,
    ServoMetrics,
    SlaveMetrics,
)

NOTHING = Summary(0)
HEAP = HeapMetrics(20_000_000, 300_000, 5)
SOFTWARE = Software("0.1.0", 3, "1.10.2", "3.11.7")


def commanded(**changes: Any) -> CommandedMetrics:
    """One robot as its master commands it."""
    given: dict[str, Any] = {
        "commands_sent": 0,
        "round_trip_ms": NOTHING,
        "robot": RobotHeard(silent=False, times_lost=0, undecodable=0, missing=0),
        "lease": LeaseHeld(held=True, answer="granted"),
        "video": VideoReceived(0, 0, 0),
        "link": {},
    }
    return CommandedMetrics(**{**given, **changes})


def master_metrics(robot: CommandedMetrics | None = None, **changes: Any) -> MasterMetrics:
    """A master's, to one robot."""
    given: dict[str, Any] = {
        "software": SOFTWARE,
        "heap": HEAP,
        "ticks": Ticks(0, 0),
        "stages_ms": {},
        "frames_in_to_put_ms": NOTHING,
        "nodes": {},
        "doubts": {},
        "beyond_reach": {},
        "switches": {"deadman": "always held"},
        "buses": {},
        "robots": {"robot-1": robot or commanded()},
    }
    return MasterMetrics(**{**given, **changes})


def guard_metrics(**changes: Any) -> GuardMetrics:
    """A guard's."""
    given: dict[str, Any] = {
        "state": "track",
        "reason": "follows",
        "received": 0,
        "accepted": 0,
        "dropped": {},
        "losses": {},
        "clamps": {},
        "doubts": {},
        "foreign_requests": 0,
        "late_steps": 0,
    }
    return GuardMetrics(**{**given, **changes})


def slave_metrics(**changes: Any) -> SlaveMetrics:
    """A robot's."""
    given: dict[str, Any] = {
        "software": SOFTWARE,
        "heap": HEAP,
        "instance": 0,
        "ticks": Ticks(0, 0),
        "guard": guard_metrics(),
        "lease": None,
        "stages_ms": {},
        "end_to_end_ms": NOTHING,
        "one_way_ms": NOTHING,
        "one_way_corrected_ms": NOTHING,
        "commands": ArrivalCounts(0, 0, 0, 0),
        "due": DueMetrics(0, 0),
        "early": 0,
        "unmoved": 0,
        "offset": OffsetMetrics(0.0, 0.0, trusted=False),
        "undecodable": {},
        "base": {},
        "servos": ServoMetrics(),
        "video": None,
        "link": {"command": TopicCounters()},
    }
    return SlaveMetrics(**{**given, **changes})
