import json

import pytest

from common.link.config import LinkConfig
from common.link.zenoh_config import zenoh_configuration
from deploy.harness.link_settings import needed_age_s, open_timeout_s
from deploy.sim.network import Profile, Way, load_profile, profile_names


@pytest.mark.parametrize(
    ("profile", "expected_s"), [("lan", 1.5), ("intercontinental", 1.5), ("geo-satellite", 4.0)]
)
def test_a_slow_line_is_given_the_round_trips_that_opening_takes(profile: str, expected_s: float) -> None:
    opening_s = open_timeout_s(load_profile(profile))
    assert opening_s == expected_s
    config = LinkConfig(listen=["tcp/127.0.0.1:7447"], open_timeout_s=opening_s)
    settings = json.loads(json.dumps(zenoh_configuration(config)))
    assert settings["transport"]["unicast"] == {
        "open_timeout": 1e3 * expected_s,
        "accept_timeout": 1e3 * expected_s,
    }


def test_commands_over_a_short_line_keep_the_guards_own_limit() -> None:
    assert needed_age_s(load_profile("4g")) == 0.3
    assert needed_age_s(load_profile("geo-satellite")) > 0.6


def one_way(delay_ms: float, jitter_ms: float = 0.0) -> Profile:
    return Profile(both=Way(delay_ms=delay_ms, jitter_ms=jitter_ms))


@pytest.mark.parametrize(
    ("delay_ms", "jitter_ms", "limit_s"),
    [(0.0, 0.0, 0.3), (150.0, 5.0, 0.3), (270.0, 0.0, 0.3), (276.0, 0.0, 0.65), (300.0, 10.0, 0.7)],
)
def test_the_guards_age_limit_is_the_default_or_what_a_long_line_needs(
    delay_ms: float, jitter_ms: float, limit_s: float
) -> None:
    assert needed_age_s(one_way(delay_ms, jitter_ms)) == limit_s


def test_every_network_profile_fits_the_guard_s_bound() -> None:
    assert all(needed_age_s(load_profile(name)) <= 2.0 for name in profile_names())
