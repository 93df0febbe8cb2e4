"""Both directions and the requests by which the link is steered; and the same profile told to netem."""

from __future__ import annotations

import pytest

from deploy.sim.network.emulation import TO_OPERATOR, TO_ROBOT, EmulatedLink, LinkRequest
from deploy.sim.network.netem import child_arguments, faithful, netem_arguments
from deploy.sim.network.profile import Profile, Way, load_profile, profile_names

MS = 1_000_000
UNEVEN = Profile.model_validate({"to_robot": {"delay_ms": 10.0}, "to_operator": {"delay_ms": 30.0}})


def test_each_direction_has_its_own_delay() -> None:
    link = EmulatedLink(UNEVEN)
    assert link.next_ns is None
    link.push(TO_OPERATOR, 0, b"state")
    link.push(TO_ROBOT, 0, b"command")
    assert link.next_ns == 10 * MS
    assert list(link.due(10 * MS)) == [(TO_ROBOT, b"command")]
    assert link.next_ns == 30 * MS
    assert list(link.due(30 * MS)) == [(TO_OPERATOR, b"state")]


def test_requests_change_the_link_and_are_answered_with_what_it_counts() -> None:
    link = EmulatedLink(UNEVEN)
    link.push(TO_ROBOT, 0, b"1234")
    counters = link.answer(LinkRequest(load_profile("4g").model_dump_json(exclude_unset=True), cut=True), 0)
    assert (counters.to_robot.bytes, counters.to_robot.planned_ns) == (4, 10 * MS)
    assert counters.to_operator.packets == 0
    assert list(link.due(10 * MS)) == []  # cut
    assert link.answer(LinkRequest(), 0).to_robot.dropped["outage"] == 1
    link.answer(LinkRequest(cut=False), 20 * MS)
    link.push(TO_OPERATOR, 20 * MS, bytes(1250))
    assert link.next_ns is not None
    assert link.next_ns > 20 * MS + (33 - 20) * MS  # 4g's delay, not below its floor


@pytest.mark.parametrize("name", profile_names())
def test_netem_is_told_every_profile(name: str) -> None:
    ways = load_profile(name).ways
    for way in (ways.to_robot, ways.to_operator):
        words = " ".join(netem_arguments(way))
        assert f"delay {way.delay_ms:g}ms" in words
        assert f"rate {way.rate_mbit:g}mbit" in " ".join(child_arguments(way))
        assert ("distribution normal" in words) == bool(way.jitter_ms)


def test_netem_s_words() -> None:
    way = Way(delay_ms=20.0, loss_percent=2.0, burst_packets=4.0, rate_mbit=12.0, queue_ms=10.0)
    # p = r × 0.02 / 0.98
    assert " ".join(netem_arguments(way)) == (
        "limit 10000 delay 20ms loss gemodel 0.510204% 25% 100% 0% rate 10000mbit"
    )
    random = netem_arguments(Way(loss_percent=2.0, duplicate_percent=1.0))
    assert random[4:] == ["loss", "random", "2%", "duplicate", "1%", "rate", "10000mbit"]
    # bytes: two packets at once, 10 ms at 12 Mbit/s waiting
    assert child_arguments(way) == ["tbf", "rate", "12mbit", "burst", "3000", "limit", "15000"]
    assert child_arguments(Way()) == ["pfifo", "limit", "10000"]


def test_only_what_netem_does_as_meant_is_left_to_it() -> None:
    assert [name for name in profile_names() if faithful(load_profile(name))] == ["lan"]
    assert faithful(UNEVEN)
