"""Hands after the last command, against what was foretold."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from common.clock import NS_PER_MS
from common.skeleton import load_skeleton
from common.wire.messages import CommandEcho, RobotState
from deploy.measure.blind import BlindOutage, blind_figures, blind_outages

SKELETON = load_skeleton("nursing")
ELBOW = SKELETON.joint_names.index("left_elbow_pitch")
ACCEPTED_MS, HELD_MS, STANDS_MS = 1_000, 1_210, 1_400
RATE_RAD_S = 0.5


def state(at_ms: int, foretold_m: float) -> RobotState:
    """The left elbow turns evenly until it stands; the newest command came at one second."""
    angles = 0.5 * (SKELETON.lower_rad + SKELETON.upper_rad)
    angles[ELBOW] += RATE_RAD_S * min(at_ms, STANDS_MS) / 1e3 - 0.6
    moving = at_ms < HELD_MS
    at_ns = at_ms * NS_PER_MS
    echo_ns = min(at_ms // 80 * 80 + 40, ACCEPTED_MS) * NS_PER_MS
    return RobotState(
        "robot-1", at_ms, at_ns, at_ns, "track" if moving else "hold",
        "follows" if moving else "no command for 0.20 s", "anna", np.ones(len(angles), np.bool_),
        angles, angles,
        CommandEcho(1, 0, echo_ns, echo_ns, echo_ns), 0, 1,
        blind_m=(foretold_m, 0.003) if moving else (), blind_s=0.4,
    )  # fmt: skip


def outage(foretold_m: float = 0.1) -> list[RobotState]:
    return [state(at_ms, foretold_m) for at_ms in range(400, 3_000, 20)]


def test_the_way_counts_from_the_last_accepted_command_until_all_stand() -> None:
    left, right = blind_outages(outage(), SKELETON)
    assert (left.hand, right.hand) == ("left_hand", "right_hand")
    arm_m = left.measured_m / (RATE_RAD_S * (STANDS_MS - ACCEPTED_MS) / 1e3)
    assert 0.2 < arm_m < 0.6, "the forearm and the hand"
    assert left.foretold_m == 0.1
    assert right.measured_m == pytest.approx(0.0, abs=1e-9)
    assert right.share is None


def test_an_outage_that_was_not_seen_whole_or_another_hold_is_none() -> None:
    unseen = [one for one in outage() if not 1_100 < one.encoder_ns / NS_PER_MS < 1_300]
    assert blind_outages(unseen, SKELETON) == []
    pressed = [
        one if one.guard == "track" else replace(one, reason="the deadman is released") for one in outage()
    ]
    assert blind_outages(pressed, SKELETON) == []
    assert blind_outages(outage()[:45], SKELETON) == []


def test_the_figures_tell_the_worst_hand() -> None:
    found = [BlindOutage(1, "left_hand", 0.1, 0.08), BlindOutage(1, "right_hand", 0.01, 0.012)]
    figures = blind_figures(found)
    assert figures.outages == 1
    assert figures.excess_cm == pytest.approx(0.2)
    assert figures.share == pytest.approx(0.8)
    assert figures.farthest_cm == pytest.approx(8.0)
    assert blind_figures([]).excess_cm is None
