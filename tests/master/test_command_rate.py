"""Which rate a master sends at: its file's, or what the slowest of its robots' lines allows."""

from __future__ import annotations

import pytest

from common.config.load import load_config
from common.errors import ConfigError
from master.capture.rate import CaptureRate
from master.command_rate import CommandRate, RateLog
from master.config import MasterConfig
from tests.master.test_pipeline import EXAMPLES


def negotiating(rate_hz: int = 200) -> CommandRate:
    return CommandRate(CaptureRate(rate_hz, "auto", None))


def test_the_slowest_robot_decides_and_one_that_says_nothing_is_sent_the_usual() -> None:
    rate = negotiating()
    assert rate.hz == 12.5
    assert rate.follow({"a": 20, "b": 40})
    assert (rate.decimation, rate.hz) == (8, 25.0)
    assert rate.words == "25 Hz: as the line to b allows"
    assert not rate.follow({"a": 20, "b": 40})
    assert rate.follow({"a": 20})
    assert rate.hz == 50.0
    assert rate.follow({"a": 20, "old version": 0})
    assert rate.hz == 12.5
    assert rate.follow({"a": 20})
    assert rate.follow({})
    assert rate.words == "12.5 Hz: no robot asks for more"


@pytest.mark.parametrize("nonsense_ms", [1, 3, 100_000])
def test_no_robot_can_ask_for_more_than_50_or_less_than_12(nonsense_ms: int) -> None:
    rate = negotiating()
    rate.follow({"a": nonsense_ms})
    assert 12.5 <= rate.hz <= 50.0


@pytest.mark.parametrize("rate_hz", [50, 60, 100, 400])
def test_suits_at_other_rates_come_as_near_as_their_ticks_do(rate_hz: int) -> None:
    rate = negotiating(rate_hz)
    rate.follow({"a": 40})
    assert rate.hz == pytest.approx(25.0, rel=0.25)


def test_a_robot_that_alternates_its_wish_does_not_flood_the_log() -> None:
    """It may change it with every look, 12.5 times a second."""
    rate, log, lines = negotiating(), RateLog(), []
    for look in range(1000):
        changed = rate.follow({"a": (20, 80)[look % 2] if 100 <= look < 500 else 80})
        line = log.line(changed, rate.words, look * 80_000_000)
        lines += [line] if line is not None else []
    assert len(lines) == 5
    assert lines[0] == "commands at 50 Hz: as the line to a allows", "a first change is said at once"
    assert all("times since the last line" in line for line in lines[1:])
    assert lines[-1].startswith("commands at 12.5 Hz"), "what holds in the end is said"


def test_a_fixed_rate_is_nobody_s_to_change() -> None:
    rate = CommandRate(CaptureRate(200, 25.0, None))
    assert not rate.follow({"a": 20})
    assert rate.hz == 25.0
    assert CommandRate(CaptureRate(200, 12.5, 5)).hz == 40.0


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        (["capture.command_hz=30"], "capture.command_hz"),
        (['capture.command_hz="fast"'], "capture.command_hz"),
        (['capture.command_hz="auto"', "capture.decimation=8"], "capture.decimation"),
    ],
)
def test_a_mistake_names_its_key(changes: list[str], named: str) -> None:
    with pytest.raises(ConfigError, match=named):
        load_config(EXAMPLES / "master.toml", MasterConfig, changes)
