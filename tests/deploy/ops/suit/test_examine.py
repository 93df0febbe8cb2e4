"""Each thing that can be wrong with a node is found in what it reads, and a good node has no trouble."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from common.quaternion import Array, conjugate, from_rotation_vector, multiply, rotate
from deploy.ops.suit.examine import Observed, examine

TICK_S = 0.005


def turned_by_hand(seconds: float = 10.0) -> Array:
    """(T, 9): still for 3 s, then turned about all axes."""
    random = np.random.default_rng(3)
    q, out = np.array([1.0, 0.0, 0.0, 0.0]), []
    for tick in range(int(seconds / TICK_S)):
        t = tick * TICK_S - 3.0
        rate = np.zeros(3) if t < 0 else 1.5 * np.sin([2.0 * t, 2.7 * t, 1.3 * t])
        q = multiply(q, from_rotation_vector(rate * TICK_S))
        acc = rotate(conjugate(q), np.array([0.0, 0.0, 9.80665]))
        out.append(np.concatenate([acc, rate, rotate(conjugate(q), np.array([0.0, 25.0, -43.0]))]))
    readings: Array = np.array(out) + np.repeat([0.04, 0.003, 0.2], 3) * random.normal(size=(len(out), 9))
    return readings


GOOD = turned_by_hand()
SEEN = Observed(GOOD, np.ones(len(GOOD), np.bool_), 200.0, {}, 0.3)


def trouble(readings: Array) -> str:
    return "; ".join(examine("head", replace(SEEN, readings=readings), TICK_S).troubles)


def changed(acc: float = 1.0, gyr: float = 1.0) -> Array:
    out: Array = GOOD * np.repeat([acc, gyr, 1.0], 3)
    return out


def test_a_good_node_has_no_trouble() -> None:
    found = examine("head", SEEN, TICK_S)
    assert found.troubles == ()
    assert (found.motion, found.axes) == ("moving", "right")
    assert found.gravity_m_s2 == pytest.approx(9.81, abs=0.05)


@pytest.mark.parametrize(
    ("readings", "words"),
    [
        (changed(acc=1 / 9.80665), 'write unit = "g"'),
        (changed(acc=1e3 / 9.80665), 'write unit = "mg"'),
        (changed(acc=0.5), "range, factor or unit"),
        (changed(gyr=180 / math.pi), 'write unit = "deg/s"'),
        (changed(gyr=math.pi / 180), 'write unit = "rad/s"'),
        (changed(gyr=2.0), "2 times what gravity turns"),
        (changed(gyr=-1.0), '"-x -y -z"'),
        (GOOD[:, [0, 1, 2, 4, 3, 5, 6, 7, 8]], '"y x z"'),
        (GOOD * np.array([1, 1, 1, 1, 1, -1, 1, 1, 1]), '"x y -z"'),
        (np.repeat(GOOD[:1], 2000, axis=0), "repeats one reading"),
    ],
    ids=["g", "mg", "half range", "deg", "rad", "gain", "left-handed", "swapped", "sign", "frozen"],
)
def test_what_is_wrong_is_said_with_what_to_do(readings: Array, words: str) -> None:
    assert words in trouble(readings)


def test_a_node_that_is_not_turned_is_not_judged() -> None:
    found = examine("head", replace(SEEN, readings=GOOD[:590], fresh=np.ones(590, np.bool_)), TICK_S)
    assert (found.motion, found.axes, found.troubles) == ("still", "not judged", ())


def test_silence_and_loss_are_said() -> None:
    silent = examine("head", replace(SEEN, fresh=np.zeros(2000, np.bool_), counts={"bad_length": 7}), TICK_S)
    assert silent.motion == "silent"
    assert "7 bad_length" in silent.troubles[0]
    losing = examine("head", replace(SEEN, counts={"missing": 100}), TICK_S)
    assert losing.lost_share == pytest.approx(0.048, abs=0.001)
    assert "samples are lost" in losing.troubles[0]
    assert examine("head", replace(SEEN, counts={"missing": 20}), TICK_S).troubles == ()


def test_what_did_not_come_while_this_host_was_stalled_is_not_lost() -> None:
    counts = {"missing": 200}
    blamed = replace(SEEN, counts=counts)
    assert "samples are lost" in "; ".join(examine("head", blamed, TICK_S).troubles)
    assert examine("head", replace(blamed, stalled_s=1.0), TICK_S).troubles == ()
    short = replace(blamed, stalled_s=0.5)
    assert "samples are lost" in "; ".join(examine("head", short, TICK_S).troubles)
