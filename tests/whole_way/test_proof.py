"""A node on the MuJoCo hand finds the simulator's truth, and a planted delay where it was planted."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from common.clock import NS_PER_MS
from deploy.experiments.prove.simulated import judge, simulate
from deploy.measure.delay import AngularSpeed
from deploy.measure.proof import (
    CAMERA,
    ENCODER,
    HAND_TO_HAND,
    HAND_TO_SETPOINT,
    LOOP,
    SCENE_TO_EYE,
    SERVO,
    ProofRow,
)

SECONDS = 22.0
pytestmark = pytest.mark.timeout(400)
NEAR_MS = 2.0
PLANTED_MS = 20


@cache
def proof(network: str, *plant: str) -> tuple[dict[str, ProofRow], float]:
    """The rows by name, and the hand's true delay in ms."""
    proved = simulate(network, SECONDS, dict.fromkeys(plant, PLANTED_MS))
    return {row.name: row for row in judge(proved)}, true_delay_ms(*proved.truth())


def true_delay_ms(operator: AngularSpeed, robot: AngularSpeed) -> float:
    """By another way than the estimator's: the shift of least squares of the noise-free speeds."""
    origin = operator.at_ns[0]
    at_ms, seen_ms = ((one.at_ns - origin) / NS_PER_MS for one in (operator, robot))
    inside = (at_ms > 500.0) & (at_ms < at_ms[-1] - 700.0)
    shifts = np.arange(-300.0, 600.0, 0.5)
    errors = [
        np.mean((operator.rad_s[inside] - np.interp(at_ms[inside] + shift, seen_ms, robot.rad_s)) ** 2)
        for shift in shifts
    ]
    best = int(np.argmin(errors))
    before, here, after = errors[best - 1 : best + 2]
    return float(shifts[best] + 0.25 * (before - after) / (before - 2.0 * here + after))


def found(rows: dict[str, ProofRow], name: str) -> float:
    row = rows[name]
    assert row.found_ms is not None, row.why
    assert row.bound_ms is not None
    return row.found_ms


@pytest.mark.parametrize("network", ["lan", "4g", "intercontinental"])
def test_the_node_finds_the_simulators_truth(network: str) -> None:
    rows, true_ms = proof(network)
    assert found(rows, HAND_TO_HAND) == pytest.approx(true_ms, abs=NEAR_MS)
    # of one host: no clock's offset is in it
    for name in (ENCODER, CAMERA):
        assert abs(found(rows, name)) <= rows[name].bound_ms + 0.1  # type: ignore[operator]
        assert not rows[name].wrong
    assert found(rows, LOOP) == found(rows, HAND_TO_HAND) + found(rows, SCENE_TO_EYE)


@pytest.mark.parametrize(
    ("place", "name", "sign", "wrong"),
    [("servo", SERVO, 1, False), ("encoder", ENCODER, 1, True), ("camera", CAMERA, 1, True)],
)
def test_a_planted_delay_is_found_where_it_was_planted(place: str, name: str, sign: int, wrong: bool) -> None:
    without, _ = proof("lan")
    rows, true_ms = proof("lan", place)
    assert found(rows, name) - found(without, name) == pytest.approx(sign * PLANTED_MS, abs=NEAR_MS)
    assert rows[name].wrong is wrong
    for other in {SERVO, ENCODER, CAMERA, HAND_TO_SETPOINT} - {name}:
        assert found(rows, other) == pytest.approx(found(without, other), abs=NEAR_MS)
        assert not rows[other].wrong
    assert found(rows, HAND_TO_HAND) == pytest.approx(true_ms, abs=NEAR_MS)
    if place == "servo":
        assert found(rows, HAND_TO_HAND) - found(without, HAND_TO_HAND) == pytest.approx(
            PLANTED_MS, abs=NEAR_MS
        )
