"""Profiles: those that come with tandem are sound, and a mistake in one's own is told."""

from __future__ import annotations

from pathlib import Path

import pytest

from common.errors import ConfigError
from deploy.sim.network.profile import load_profile, profile_names

SHIPPED = {"lan", "wifi", "5g", "4g", "adsl", "intercontinental", "geo-satellite", "flaky-wifi"}


def test_those_that_come_with_tandem() -> None:
    names = profile_names()
    assert set(names) == SHIPPED
    assert names[0] == "lan"
    assert names[-1] == "geo-satellite"


@pytest.mark.parametrize("name", sorted(SHIPPED))
def test_each_says_what_it_is_and_where_its_figures_are_from(name: str) -> None:
    profile = load_profile(name)
    assert profile.name == name
    assert profile.about
    assert len(profile.source) > 100


def test_a_direction_wins_over_both() -> None:
    ways = load_profile("adsl").ways
    assert ways.to_robot.rate_mbit == 12.0
    assert ways.to_operator.rate_mbit == 1.0
    assert ways.to_robot.delay_ms == ways.to_operator.delay_ms == 15.0


def test_one_of_your_own_by_its_path_and_keys_set_over_it(tmp_path: Path) -> None:
    file = tmp_path / "ward 3.toml"
    file.write_text("[both]\ndelay_ms = 7.0\n", "utf-8")
    profile = load_profile(file, ["to_robot.loss_percent=2.5"])
    assert profile.name == "ward 3"
    assert profile.ways.to_robot.loss_percent == 2.5
    assert profile.ways.to_operator.loss_percent == 0.0


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[both]\ndelay_ms = -1.0", r"mine.toml: both.delay_ms = -1.0: expected greater than or equal to 0"),
        ("[both]\nlos_percent = 1.0", "both.los_percent = 1.0: expected no such key"),
        ("[both]\njitter_ms = 5.0", "both.jitter_ms = 5.0: expected at most delay_ms, 0"),
        (
            "[both]\ndelay_ms = 9.0\n[to_operator]\njitter_ms = 10.0",
            "to_operator.jitter_ms = 10.0: expected at most delay_ms, 9",
        ),
        (
            "[both]\nloss_percent = 70.0\nburst_packets = 3.0\nloss_in_burst_percent = 60.0",
            "both.loss_percent = 70.0: expected from loss_between_percent, 0, to below loss_in_burst_percent",
        ),
        (
            "[both]\nloss_percent = 80.0\nburst_packets = 3.0",
            "both.burst_packets = 3.0: expected 4 or more, to lose so much",
        ),
        (
            "outages = [{ at_s = 1.0, for_s = 2.0 }, { at_s = 2.5, for_s = 1.0 }]",
            "outages.1.at_s = 2.5: expected after the outage before it, at 3 s or later",
        ),
    ],
)
def test_a_mistake_names_file_key_value_and_expectation(tmp_path: Path, text: str, said: str) -> None:
    file = tmp_path / "mine.toml"
    file.write_text(text, "utf-8")
    with pytest.raises(ConfigError, match=said):
        load_profile(file)


def test_an_unknown_name_is_answered_with_the_known_ones() -> None:
    with pytest.raises(
        ConfigError, match=r"profile = '6g': expected one of lan, .*4g.*, or a path to a .toml"
    ):
        load_profile("6g")
