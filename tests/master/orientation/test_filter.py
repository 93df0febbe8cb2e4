import numpy as np
import pytest

from common.quaternion import Array
from master.orientation.filter import FilterSection
from master.orientation.filters import FilterBank
from master.orientation.mahony import MahonyConfig
from master.orientation.vqf import VqfConfig, VqfFilter

RATE_HZ = 200.0
NAMES = ["vqf", "mahony", "vqf", "mahony", "mahony"]
SECTIONS: dict[str, FilterSection] = {"vqf": VqfConfig(), "mahony": MahonyConfig(ki=0.1)}


def bank_of(names: list[str]) -> FilterBank:
    return FilterBank(names, SECTIONS, RATE_HZ)


def readings(ticks: int, nodes: int, seed: int = 0) -> list[tuple[Array, Array, Array]]:
    rng = np.random.default_rng(seed)
    return [
        (
            rng.normal(size=(nodes, 3)),
            rng.normal(size=(nodes, 3)) + [0.0, 0.0, 9.81],
            rng.normal(size=(nodes, 3)) + [0.0, 28.0, -39.0],
        )
        for _ in range(ticks)
    ]


def test_each_node_has_the_filter_it_names() -> None:
    bank = bank_of(NAMES)
    alone = [SECTIONS[name].make(RATE_HZ, 1) for name in NAMES]
    for tick in readings(50, 5):
        bank.update(*tick)
        for i, one in enumerate(alone):
            gyr, acc, mag = (part[i : i + 1] for part in tick)
            one.update(gyr, acc, mag)
    q, bias = bank.q_world_from_sensor(), bank.bias_rad_s()
    assert q.shape == (5, 4)
    for i, one in enumerate(alone):
        assert np.allclose(q[i], one.q_world_from_sensor()[0], atol=1e-14)
        assert np.allclose(bias[i], one.bias_rad_s()[0], atol=1e-14)


@pytest.mark.parametrize("names", [NAMES, ["vqf"] * 5, ["mahony"] * 5])
def test_restart_reaches_the_right_nodes(names: list[str]) -> None:
    bank, fresh, old = bank_of(names), bank_of(names), bank_of(names)
    for tick in readings(50, 5):
        bank.update(*tick)
        old.update(*tick)
    again = np.array([False, True, True, False, False])
    bank.restart(again)
    (tick,) = readings(1, 5, seed=1)
    for each in (bank, fresh, old):
        each.update(*tick)
    found = bank.q_world_from_sensor()
    assert np.allclose(found[again], fresh.q_world_from_sensor()[again], atol=1e-14)
    assert np.allclose(found[~again], old.q_world_from_sensor()[~again], atol=1e-14)


def test_vqf_without_a_magnetometer_for_a_while_keeps_its_heading() -> None:
    vqf = VqfFilter(VqfConfig(), RATE_HZ, 2)
    rest = np.zeros((2, 3)), np.tile([0.0, 0.0, 9.81], (2, 1)), np.tile([20.0, 20.0, -39.0], (2, 1))
    for _ in range(400):
        vqf.update(*rest)
    before = vqf.q_world_from_sensor()
    without = rest[2].copy()
    without[1] = np.nan
    for _ in range(400):
        vqf.update(rest[0], rest[1], without)
    assert np.allclose(vqf.q_world_from_sensor(), before, atol=1e-3)
