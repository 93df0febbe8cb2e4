"""Least distances of a run: of the operator, of setpoints and of encoders, each from its own series."""

from __future__ import annotations

from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from common.quaternion import Array
from common.skeleton import load_skeleton
from common.wire.messages import RobotState
from deploy.experiments.demo.nearness import nearness, nearness_text
from deploy.measure import TruthSeries
from tests.slave.limit.apart import CROSSED, SKELETON

ZERO_M = 0.045


def truth(position_rad: Array) -> TruthSeries:
    ticks = np.arange(len(position_rad))
    return TruthSeries(ticks, ticks, position_rad)


def state(setpoint: Array, encoders: Array, guard: str = "track", words: str = "") -> RobotState:
    faults = {"distance": words} if words else {}
    return cast(
        RobotState,
        SimpleNamespace(guard=guard, setpoint_rad=setpoint, position_rad=encoders, faults=faults),
    )


def test_each_series_has_its_own_figure_and_words_come_once() -> None:
    zero, half = np.zeros_like(CROSSED), 0.5 * CROSSED
    states = [
        state(zero, zero), state(zero, half, words="a is held back"),
        state(zero, zero, words="a is held back"),
        state(CROSSED, CROSSED, guard="hold"),
    ]  # fmt: skip
    found = nearness(truth(np.array([CROSSED])), states, SKELETON, 0.02)
    assert found is not None
    assert found.operator_m < -0.05
    assert found.setpoint_m == pytest.approx(ZERO_M)
    assert found.encoder_m != found.setpoint_m
    assert found.held_back == ("a is held back",)
    assert "robot 4.5 cm" in nearness_text(found).plain


def test_nothing_heard_or_nothing_to_meet_is_none() -> None:
    zero = np.zeros_like(CROSSED)
    assert nearness(truth(np.array([zero])), [], SKELETON, 0.02) is None
    hand = load_skeleton("hand")
    still = np.zeros(len(hand.joints))
    assert nearness(truth(np.array([still])), [state(still, still)], hand, 0.02) is None
