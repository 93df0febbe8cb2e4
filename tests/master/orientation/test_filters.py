"""Every filter in the registry keeps the contract, is in the README, and is selected by a TOML file."""

from pathlib import Path

import numpy as np
import pytest
from pydantic import Field

from master import orientation
from master.orientation.config import EstimationConfig
from master.orientation.estimator import Estimator
from master.orientation.filter import FilterSection, OrientationFilter
from master.orientation.filters import FILTERS
from master.orientation.mahony import MahonyConfig, MahonyFilter
from master.suit.nodes import NodeConfig

from .filter_contract import FilterContract
from .perfect import GRAVITY, RATE_HZ


class TestEveryFilter(FilterContract):
    @pytest.fixture(params=list(FILTERS))
    def section(self, request: pytest.FixtureRequest) -> FilterSection:
        return FILTERS[request.param]()


class SlowConfig(FilterSection):
    """Another filter's section."""

    gain: float = Field(default=0.1, gt=0.0)

    def make(self, rate_hz: float, count: int) -> OrientationFilter:
        return MahonyFilter(MahonyConfig(kp=self.gain), rate_hz, count)


def test_a_filter_is_added_by_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(FILTERS, "slow", SlowConfig)
    config = EstimationConfig.model_validate({"filter": "slow", "slow": {"gain": 0.2}})
    assert config.filter_sections["slow"] == SlowConfig(gain=0.2)
    assert config.mistakes_at(RATE_HZ) == []
    bank = Estimator(config, [NodeConfig(id=1, bus="b")], RATE_HZ)._bank
    ((_, filter_),) = bank._parts
    assert isinstance(filter_, MahonyFilter)
    assert filter_._config.kp == 0.2


@pytest.mark.parametrize("name", list(FILTERS))
def test_the_readme_has_every_parameter_with_its_default(name: str) -> None:
    text = (Path(next(iter(orientation.__path__))) / "README.md").read_text("utf-8")
    rows = text.partition(f"| `[estimation.{name}]` |")[2].partition("\n\n")[0].splitlines()[2:]
    found = [row.split("|")[1:3] for row in rows]
    expected = {
        key: str(value).replace("True", "true") for key, value in FILTERS[name]().model_dump().items()
    }
    assert {key.strip(" `"): default.strip() for key, default in found} == expected


def test_a_toml_gives_each_node_its_filter_and_each_filter_its_keys() -> None:
    nodes = [
        NodeConfig.model_validate({"id": i, "bus": "b", "filter": name})
        for i, name in enumerate([*FILTERS, None], 1)
    ]
    config = EstimationConfig.model_validate({"filter": "ekf", "ekf": {"bias_limit_rad_s": 0.001}})
    estimator, rest_ = Estimator(config, nodes, RATE_HZ), Readings()
    for _ in range(800):
        estimator.update(rest_)
    bias = np.abs(estimator._bank.bias_rad_s()).max(axis=1)
    # two run ekf, by their own choice and by the suit's, and stop where the suit's file says
    assert np.allclose(bias[2:], 0.001)
    assert np.max(np.abs(bias[:2] - 0.001)) > 1e-4


class Readings:
    """Four nodes at rest on the table, with a bias."""

    acc_m_s2 = np.tile(GRAVITY, (4, 1))
    gyr_rad_s = np.full((4, 3), 0.02)
    mag_ut = np.full((4, 3), np.nan)
    fresh = np.ones(4, dtype=np.bool_)
    lost = np.zeros(4, dtype=np.bool_)
