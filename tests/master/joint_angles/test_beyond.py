"""What the robot cannot follow is counted, and told once, when it lasts."""

from __future__ import annotations

import numpy as np

from common.clock import NS_PER_MS
from master.joint_angles.beyond import BeyondReach

PERIOD_NS = 80 * NS_PER_MS


def told(beyond: BeyondReach, arm_deg: list[float], first: int = 0) -> list[str]:
    return [
        line
        for k, deg in enumerate(arm_deg, start=first)
        for line in beyond.note(k * PERIOD_NS, np.radians([deg, 0.0]))
    ]


def test_nothing_is_said_of_an_operator_within_reach() -> None:
    beyond = BeyondReach(["arm", "hand"])
    assert told(beyond, [0.0, 4.9, 0.0] * 50) == []
    assert beyond.metrics() == {}


def test_what_lasts_is_reported_every_ten_seconds_with_segment() -> None:
    beyond = BeyondReach(["arm", "hand"])
    lines = told(beyond, [40.0] * 120)
    assert len(lines) == 1
    assert lines[0].startswith("arm: the operator is 40° beyond")
    assert len(told(beyond, [40.0] * 125, first=120)) == 1


def test_what_flickers_does_not_flood_and_what_passes_is_not_told() -> None:
    beyond = BeyondReach(["arm", "hand"])
    assert told(beyond, [40.0, 40.0, 0.0] * 100) == []
    assert len(told(beyond, ([40.0] * 8 + [0.0]) * 50, first=300)) == 4


def test_share_newest_and_most_are_counted() -> None:
    beyond = BeyondReach(["arm", "hand"])
    told(beyond, [0.0] * 6 + [20.0, 30.0, 10.0, 2.0])
    arm = beyond.metrics()["arm"]
    assert (arm.percent, arm.now_deg, arm.most_deg) == (30.0, 2.0, 30.0)


def test_a_node_that_is_not_heard_is_not_beyond_reach() -> None:
    beyond = BeyondReach(["arm", "hand"])
    assert beyond.note(0, np.array([np.nan, np.nan])) == []
    assert beyond.metrics() == {}
