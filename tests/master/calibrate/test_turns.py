import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from common.quaternion import Array
from master.calibrate.turns import moving_readings, turns

DT_S = 0.01
GAIN: Array = np.array([[1.02, 0.01, -0.02], [0.0, 0.97, 0.015], [-0.01, 0.02, 1.01]])


def readings(count: int = 300, dt_s: float = DT_S) -> Array:
    t = np.arange(count)[:, None] * dt_s
    return np.column_stack([2 * np.sin(3 * t), 1.5 * np.cos(2 * t), 3 * np.sin(t + 1)])


def test_an_even_turn_of_any_length() -> None:
    rate = np.array([0.4, -1.1, 0.7])
    moving = np.array([[0, 1], [0, 100], [5, 42], [10, 11], [0, 199]])
    pairs, counts = moving_readings(np.tile(rate, (200, 1)), moving)
    assert counts.tolist() == [1, 100, 37, 1, 199]
    q, _ = turns(np.eye(3), pairs, counts, DT_S)
    expected = Rotation.from_rotvec(counts[:, None] * DT_S * rate).as_quat(scalar_first=True)
    assert np.allclose(np.abs(np.sum(q * expected, axis=1)), 1.0, atol=1e-12)


def test_a_turn_about_a_changing_axis_against_products_of_small_ones() -> None:
    fine = readings(299 * 10 + 1, DT_S / 10)
    product = Rotation.identity()
    for rate in 0.5 * (fine[1:] + fine[:-1]) @ GAIN.T:
        product = product * Rotation.from_rotvec(rate * DT_S / 10)
    pairs, counts = moving_readings(readings(), np.array([[0, 299]]))
    q, _ = turns(GAIN, pairs, counts, DT_S)
    off = product.inv() * Rotation.from_quat(q[0], scalar_first=True)
    assert off.magnitude() < 2e-4


def test_derivatives_are_those_of_differences() -> None:
    pairs, counts = moving_readings(readings(), np.array([[0, 299], [20, 83], [100, 101]]))
    _, slope = turns(GAIN, pairs, counts, DT_S)
    for n in range(9):
        step = np.zeros(9)
        step[n] = 1e-6
        ahead, _ = turns(GAIN + step.reshape(3, 3), pairs, counts, DT_S)
        behind, _ = turns(GAIN - step.reshape(3, 3), pairs, counts, DT_S)
        assert np.allclose(slope[:, n], (ahead - behind) / 2e-6, atol=1e-8)


def test_without_derivatives_the_turns_are_the_same() -> None:
    pairs, counts = moving_readings(readings(), np.array([[0, 299], [20, 83]]))
    q, slope = turns(GAIN, pairs, counts, DT_S, slopes=False)
    assert np.array_equal(q, turns(GAIN, pairs, counts, DT_S)[0])
    assert slope.shape == (2, 0, 4)


@pytest.mark.parametrize("block", [1, 7, 100_000])
def test_blocks_make_no_difference(monkeypatch: pytest.MonkeyPatch, block: int) -> None:
    pairs, counts = moving_readings(readings(), np.array([[0, 299], [20, 83]]))
    expected, _ = turns(GAIN, pairs, counts, DT_S)
    monkeypatch.setattr("master.calibrate.turns._BLOCK", block)
    assert np.allclose(turns(GAIN, pairs, counts, DT_S)[0], expected, atol=1e-15)
