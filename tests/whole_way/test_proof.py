"""A node on the MuJoCo hand finds the simulator's truth, and a planted delay where it was planted."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from common.clock import NS_PER_MS
from common.quaternion import Array
from deploy.experiments.prove.simulated import judge, simulate
from deploy.measure.delay import SEARCH_S, SEGMENT_S, SMOOTH_S, AngularSpeed
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
    """By another way than the estimator's: the shift of least squares of the noise-free speeds.

    Over the same windows and of the same band: prediction over a long line makes the delay of one stretch,
    and that of slow and of fast motion, differ by some ms.
    """
    origin = operator.at_ns[0]
    end_ms = float(operator.at_ns[-1] - origin) / NS_PER_MS
    first_ms = -1e3 * SEARCH_S[0]
    windows = int((end_ms - 1e3 * SEARCH_S[1] - first_ms) // (1e3 * SEGMENT_S))
    at_ms = first_ms + np.arange(windows * 1e3 * SEGMENT_S)
    moved = less_its_means(smoothed(operator, origin, at_ms), windows)
    shifts = np.arange(-300.0, 600.0, 1.0)
    seen = smoothed(robot, origin, np.arange(at_ms[0] + shifts[0], at_ms[-1] + shifts[-1] + 1.0))
    errors = [
        np.mean((moved - less_its_means(seen[shift : shift + len(at_ms)], windows)) ** 2)
        for shift in range(len(shifts))
    ]
    best = int(np.argmin(errors))
    before, here, after = errors[best - 1 : best + 2]
    return float(shifts[best] + 0.5 * (before - after) / (before - 2.0 * here + after))


def less_its_means(value: Array, windows: int) -> Array:
    each = value.reshape(windows, -1)
    out: Array = (each - each.mean(axis=1, keepdims=True)).ravel()
    return out


def smoothed(speed: AngularSpeed, origin_ns: int, at_ms: Array) -> Array:
    """The speed at each ms, without what is faster than the estimator looks at."""
    sigma_ms = 1e3 * SMOOTH_S
    reach = np.arange(-4.0 * sigma_ms, 4.0 * sigma_ms + 1.0)
    wide_ms = np.arange(at_ms[0] + reach[0], at_ms[-1] + reach[-1] + 0.5)
    kernel = np.exp(-0.5 * (reach / sigma_ms) ** 2)
    value = np.interp(wide_ms, (speed.at_ns - origin_ns) / NS_PER_MS, speed.rad_s)
    return np.convolve(value, kernel / kernel.sum(), mode="valid")


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
