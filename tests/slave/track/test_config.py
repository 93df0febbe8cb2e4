"""The table of strategies: each keeps the contract, and a line adds one."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from common.config.load import check_config
from common.errors import ConfigError
from common.quaternion import Array
from slave.track import TrackTarget
from slave.track.config import STRATEGIES, TrackConfig, make_tracker
from slave.track.latest import Latest
from tests.slave.track.contract import check


@pytest.mark.parametrize("strategy", STRATEGIES)
def test_every_strategy_keeps_the_contract(strategy: str) -> None:
    check(lambda: make_tracker(TrackConfig(strategy=strategy)))


def test_a_line_in_the_table_adds_a_strategy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(STRATEGIES, "mine", lambda config, bus_lag_s: Latest())
    config = check_config(Path("slave.toml"), {"strategy": "mine"}, TrackConfig)
    assert isinstance(make_tracker(config), Latest)


def test_a_strategy_that_does_not_exist_is_refused() -> None:
    with pytest.raises(
        ConfigError, match=r"strategy = 'guess': expected 'latest', 'interpolate' or 'predict'"
    ):
        check_config(Path("slave.toml"), {"strategy": "guess"}, TrackConfig)


def test_the_old_name_of_latest_is_refused_and_the_new_one_named() -> None:
    with pytest.raises(ConfigError, match=r"strategy = 'hold': expected 'latest', the new name"):
        check_config(Path("slave.toml"), {"strategy": "hold"}, TrackConfig)


class Forgetful(Latest):
    def reset(self) -> None: ...


class Believing(Latest):
    def accept(self, sampled_ns: int, now_ns: int, position_rad: Array, velocity_rad_s: Array) -> None:
        super().accept(now_ns, now_ns, position_rad, velocity_rad_s)


class Still(Latest):
    def target(self, now_ns: int) -> TrackTarget | None:
        target = super().target(now_ns)
        return target and TrackTarget(np.zeros_like(target.position_rad), target.velocity_rad_s)


@pytest.mark.parametrize("kind", [Forgetful, Believing, Still])
def test_the_contract_finds_a_strategy_that_breaks_it(kind: type[Latest]) -> None:
    with pytest.raises(AssertionError):
        check(kind)
