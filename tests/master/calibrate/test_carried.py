import numpy as np
import pytest

from common.quaternion import Array, conjugate, from_rotation_vector, multiply, rotate
from master.calibrate.carried import axes_text, carried, confusion, signed_permutations

RATE_HZ = 100.0


def turning(seconds: float = 30.0, seed: int = 0) -> tuple[Array, Array]:
    """Rates of a unit that is turned about freely, and its orientations."""
    rng = np.random.default_rng(seed)
    t = np.arange(round(seconds * RATE_HZ)) / RATE_HZ
    phase = rng.uniform(0.0, 2.0 * np.pi, 3)
    rates = 1.5 * np.sin(t[:, None] * [0.7, 1.1, 0.9] + phase)
    q = [np.array([1.0, 0.0, 0.0, 0.0])]
    for rate in 0.5 * (rates[1:] + rates[:-1]):
        q.append(multiply(q[-1], from_rotation_vector(rate / RATE_HZ)))
    return rates, np.array(q)


RATES, Q = turning()
UP: Array = rotate(conjugate(Q), np.array([0.0, 0.0, 9.80665]))


def test_there_are_48_ways() -> None:
    ways = signed_permutations()
    assert len(ways) == len({way.tobytes() for way in ways}) == 48
    assert np.array_equal(ways[0], np.eye(3))


@pytest.mark.parametrize("way", range(48))
def test_the_gyroscopes_axes_are_found_with_its_unit_and_a_bias(way: int) -> None:
    axes = signed_permutations()[way]
    noise = np.random.default_rng(way).normal(scale=(0.01, 0.2), size=(len(UP), 3, 2))
    rates = np.degrees(RATES @ axes + 0.05 + noise[..., 0])
    found = carried(UP + noise[..., 1], rates, RATE_HZ)
    assert found is not None
    assert np.array_equal(found.axes, axes)
    assert found.scale == pytest.approx(np.pi / 180.0, rel=0.01)
    assert found.confused == (way != 0)


def test_a_unit_that_turns_about_one_axis_only_tells_nothing() -> None:
    assert carried(UP, RATES * [1.0, 0.0, 0.0], RATE_HZ) is None
    assert carried(UP, 0.0 * RATES, RATE_HZ) is None
    assert carried(UP[:200], RATES[:200], RATE_HZ) is None


def test_missing_readings_are_left_out() -> None:
    up = UP.copy()
    up[500:700] = np.nan
    found = carried(up, RATES, RATE_HZ)
    assert found is not None
    assert found.explained > 0.999


def test_axes_in_words() -> None:
    axes = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
    assert axes_text(axes) == "y,x,-z"
    assert confusion(axes) == "its x and y axes are swapped, z negated"
    assert confusion(np.diag([1.0, -1.0, 1.0])) == "its y axis is negated"
    assert confusion(np.diag([1.0, -1.0, -1.0])) == "its y and z axes are negated"
