"""The better of two bounds: it holds with honest statements; a lie beyond the round trip is noticed."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

from hypothesis import given
from hypothesis import strategies as st

from common.clock import NS_PER_MS, NS_PER_S
from common.clock_sync import ROUND_TRIP, BestOffset, MasterExchange, Offset, SlaveExchange
from common.clock_sync.best import DISTRUST_NS
from common.clock_sync.reference import (
    DAY_NS,
    LEAP_NS,
    OLD_NS,
    OSCILLATOR_PPB,
    SETTLE_NS,
    ReferenceTrack,
    Statement,
    interval_at,
)
from common.wire.codec import decode, encode
from common.wire.messages import ClockQuery, ClockReference, ClockReply

UTC_NS = 1_800_000_000 * NS_PER_S
AHEAD_NS = 7_000 * NS_PER_S
"""The slave's clock minus the master's."""
TRIP = Offset(AHEAD_NS, 50 * NS_PER_MS, trusted=True)


def states(at_ns: int, ahead_ns: int, error_ns: int = 100_000) -> ClockReference:
    return ClockReference(at_ns, ahead_ns, error_ns, 0, OSCILLATOR_PPB, "chrony", "utc")


def both(now_ns: int, lie_ns: int = 0) -> tuple[ClockReference, ClockReference]:
    """What the master's host and the slave's state; the slave's is wrong by the lie."""
    return states(now_ns, UTC_NS), states(now_ns + AHEAD_NS, UTC_NS - AHEAD_NS + lie_ns)


@given(
    there_us=st.integers(0, 200_000),
    back_us=st.integers(0, 200_000),
    errors_us=st.tuples(st.floats(-1, 1), st.floats(-1, 1), st.integers(1, 50_000), st.integers(1, 50_000)),
    rates_ppm=st.tuples(st.integers(-200, 200), st.integers(-200, 200)),
    until_s=st.integers(1, 14),
)
def test_the_bound_holds_over_any_line_with_honest_statements(
    there_us: int,
    back_us: int,
    errors_us: tuple[float, float, int, int],
    rates_ppm: tuple[int, int],
    until_s: int,
) -> None:
    """Both oscillators are wrong, and so is each statement, by its share of what it states."""
    shares, widths_us = errors_us[:2], errors_us[2:]

    def clock(host: int, true_ns: int) -> int:
        return host * AHEAD_NS + true_ns + true_ns * rates_ppm[host] // 10**6

    master, slave = MasterExchange(), SlaveExchange()
    tracks = (ReferenceTrack(), ReferenceTrack())
    true_ns = NS_PER_S
    for _ in range(4 * until_s):
        for host, side in ((0, master), (1, slave)):
            own_ns = clock(host, true_ns)
            wrong_ns = round(shares[host] * widths_us[host] * 1000)
            error_ns = widths_us[host] * 1000 + 1
            tracks[host].take(
                Statement(own_ns, UTC_NS + true_ns - own_ns + wrong_ns, error_ns, "chrony", "utc")
            )
            side.tell(tracks[host].reference(own_ns), tracks[host].steps)
        query = decode(encode(master.query(clock(0, true_ns))), ClockQuery)
        heard_ns = true_ns + there_us * 1000
        reply = slave.on_query(query, clock(1, heard_ns), clock(1, heard_ns))
        back_ns = heard_ns + back_us * 1000
        assert master.on_reply(decode(encode(reply), ClockReply), clock(0, back_ns))
        true_ns = max(true_ns + NS_PER_S // 4, back_ns)
    for host, side in ((0, master), (1, slave)):
        best, trip = side.estimate(clock(host, true_ns)), side.estimator.estimate(clock(host, true_ns))
        truth_ns = clock(1, true_ns) - clock(0, true_ns)
        assert abs(best.offset_ns - (truth_ns if host == 0 else -truth_ns)) <= best.bound_ns
        assert best.bound_ns <= trip.bound_ns
        assert side.best.contradictions == 0


def test_over_a_one_sided_line_the_statements_know_what_the_midpoint_does_not() -> None:
    best = BestOffset()
    own, remote = both(NS_PER_S)
    best.heard(remote, NS_PER_S)
    midpoint = Offset(AHEAD_NS + 40 * NS_PER_MS, 50 * NS_PER_MS, trusted=True)  # 90 ms there, 10 ms back
    found = best.estimate(NS_PER_S, midpoint, own)
    assert abs(found.offset_ns - AHEAD_NS) <= found.bound_ns < NS_PER_MS
    assert best.source == "chrony"
    assert best.words.endswith("ms stated by chrony; round trip ± 50.000 ms")


def test_a_statement_that_is_wider_than_the_round_trip_is_not_used() -> None:
    best = BestOffset()
    own, remote = both(0)
    best.heard(replace(remote, error_ns=49_950_000), 0)
    assert best.estimate(0, TRIP, own) == TRIP
    assert best.source == ROUND_TRIP
    assert "narrower than" in best.words


def test_a_lie_is_noticed_just_beyond_what_the_round_trip_allows() -> None:
    # the round trip's half width, both stated errors, and what an oscillator does in that half width
    within_ns = TRIP.bound_ns + 200_000 + TRIP.bound_ns * OSCILLATOR_PPB // 10**9 + 4
    for lie_ns, noticed in ((within_ns - 10, False), (within_ns + 10, True)):
        for sign in (1, -1):
            best = BestOffset()
            own, remote = both(NS_PER_S, sign * lie_ns)
            best.heard(remote, NS_PER_S)
            found = best.estimate(NS_PER_S, TRIP, own)
            assert (best.contradictions == 1) is noticed
            assert (best.source == ROUND_TRIP) is noticed
            assert (found == TRIP) is noticed
            if noticed:
                assert best.words.startswith("half the round trip: chrony is not believed")
                best.estimate(NS_PER_S, TRIP, own)
                assert best.contradictions == 1  # each statement counts once


def test_after_a_lie_no_statement_is_believed_for_a_minute() -> None:
    best = BestOffset()
    own, liar = both(0, 400 * NS_PER_MS)
    best.heard(liar, 0)
    best.estimate(0, TRIP, own)
    for now_ns, source in ((DISTRUST_NS - 1, ROUND_TRIP), (DISTRUST_NS, "chrony")):
        own, honest = both(now_ns)
        best.heard(honest, now_ns)
        best.estimate(now_ns, TRIP, own)
        assert best.source == source


def test_nothing_is_believed_without_both_hosts_one_scale_and_a_fresh_exchange() -> None:
    now_ns = NS_PER_S
    own, remote = both(now_ns)
    stale = Offset(AHEAD_NS, 1, trusted=False)
    for trip, ours, theirs, why in (
        (stale, own, remote, "stale"),
        (TRIP, None, remote, "here"),
        (TRIP, own, None, "other host"),
        (TRIP, own, replace(remote, scale="ptp 00aa"), "different clocks (utc, ptp 00aa)"),
        (TRIP, replace(own, at_ns=now_ns - OLD_NS - 1), remote, "here"),
    ):
        best = BestOffset()
        best.heard(theirs, now_ns)
        assert best.estimate(now_ns, trip, ours) == trip
        assert why in best.words
    best = BestOffset()
    best.heard(remote, now_ns - OLD_NS - 1)
    assert best.estimate(now_ns, TRIP, own) == TRIP


def stated(at_s: float, ahead_ns: int, error_ns: int = 10_000, leaps: bool = False) -> Statement:
    return Statement(round(at_s * NS_PER_S), ahead_ns, error_ns, "chrony", "utc", leaps)


def test_a_step_is_counted_and_nothing_is_stated_until_it_has_settled() -> None:
    track = ReferenceTrack()
    track.take(stated(0, UTC_NS))
    track.take(stated(1, UTC_NS + 20_000 + OSCILLATOR_PPB))  # both errors and the oscillator's most: no step
    assert track.steps == 0
    track.take(stated(2, UTC_NS + NS_PER_S))  # a leap second, or `chronyc makestep`
    assert track.steps == 1
    settled_s = 2 + SETTLE_NS / NS_PER_S
    for at_s in (3, settled_s - 0.001, settled_s):
        track.take(stated(at_s, UTC_NS + NS_PER_S))
        assert (track.reference(round(at_s * NS_PER_S)) is not None) is (at_s >= settled_s)


def test_near_midnight_nothing_is_stated_while_a_leap_second_is_announced() -> None:
    midnight_ns = UTC_NS - UTC_NS % DAY_NS
    for from_midnight_ns, leaps, states_it in (
        (LEAP_NS, True, False),
        (LEAP_NS + 1, True, True),
        (-LEAP_NS, True, False),
        (-LEAP_NS - 1, True, True),
        (0, False, True),
    ):
        track = ReferenceTrack()
        track.take(stated(0, midnight_ns + from_midnight_ns, leaps=leaps))
        assert (track.reference(0) is not None) is states_it


@given(rate_ppm=st.integers(-200, 200), error_ns=st.integers(0, 200_000), later_s=st.integers(0, 14))
def test_a_statement_ages_by_the_rate_that_was_seen(rate_ppm: int, error_ns: int, later_s: int) -> None:
    track = ReferenceTrack()
    for second in range(30):
        wrong_ns = error_ns if second % 2 else -error_ns
        track.take(stated(second, UTC_NS + second * 1000 * rate_ppm + wrong_ns, error_ns))
    reference = track.reference(29 * NS_PER_S)
    assert reference is not None
    low, high = interval_at(reference, (29 + later_s) * NS_PER_S)
    assert low <= UTC_NS + (29 + later_s) * 1000 * rate_ppm <= high
    assert (high - low) // 2 <= error_ns + later_s * (OSCILLATOR_PPB + 1) + 2


def test_a_service_that_falls_silent_or_is_another_starts_anew() -> None:
    track = ReferenceTrack()
    for second in range(20):
        track.take(stated(second, UTC_NS))
    known = track.reference(19 * NS_PER_S)
    assert known is not None
    assert known.rate_error_ppb < OSCILLATOR_PPB
    assert track.reference(19 * NS_PER_S + OLD_NS) is not None
    assert track.reference(19 * NS_PER_S + OLD_NS + 1) is None
    track.take(Statement(20 * NS_PER_S, 0, 10, "ptp", "ptp 00aa"))  # another scale is no step
    assert track.steps == 0
    other = track.reference(20 * NS_PER_S)
    assert other is not None
    assert (other.source, other.rate_error_ppb) == ("ptp", OSCILLATOR_PPB)
    track.silent()
    assert track.reference(20 * NS_PER_S) is None


def test_where_the_source_changes_the_offset_goes_slowly_and_its_bound_holds_all_the_way() -> None:
    """90 ms there, 10 ms back: the midpoint is 40 ms off when the statements begin, and when they end."""
    best, truth_ns = BestOffset(), AHEAD_NS
    midpoint = Offset(AHEAD_NS + 40 * NS_PER_MS, 50 * NS_PER_MS, trusted=True)
    told: list[Offset] = []
    for tick in range(5000):
        now_ns = tick * 5 * NS_PER_MS
        stating = 500 <= tick < 3000
        own, remote = both(now_ns)
        best.heard(remote if stating else None, now_ns)
        told.append(best.estimate(now_ns, midpoint, own))
    steps_ns = [abs(after.offset_ns - before.offset_ns) for before, after in pairwise(told)]
    assert max(steps_ns) <= 25_100, "5 ms a second, and what the statements' own rate allows"
    assert all(abs(each.offset_ns - truth_ns) <= each.bound_ns for each in told)
    assert told[2900].bound_ns < NS_PER_MS, "it has arrived"
    assert told[-1] == midpoint


def test_after_a_lie_it_goes_back_at_once() -> None:
    best = BestOffset()
    own, remote = both(0, lie_ns=40 * NS_PER_MS)
    best.heard(remote, 0)
    assert best.estimate(0, TRIP, own).bound_ns < NS_PER_MS
    own, remote = both(NS_PER_S, lie_ns=500 * NS_PER_MS)
    best.heard(remote, NS_PER_S)
    closer = Offset(AHEAD_NS, 5 * NS_PER_MS, trusted=True)
    assert best.estimate(NS_PER_S, closer, own) == closer, "what was told was no true bound"
