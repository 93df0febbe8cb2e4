import math
from dataclasses import dataclass

from hypothesis import given, settings
from hypothesis import strategies as st

from common.clock import NS_PER_S, to_ns
from common.clock_sync import (
    NEVER_MEASURED,
    RAW_CLOCKS,
    UNKNOWN_NS,
    MasterExchange,
    Offset,
    OffsetEstimator,
    RateLaw,
    SlaveExchange,
)
from common.clock_sync.exchange import MOST_ASKERS
from common.wire.messages import ClockQuery, ClockReply

MS = 1_000_000
HOUR = 3600 * NS_PER_S


@dataclass(frozen=True)
class RemoteClock:
    """A clock that is ahead and drifts, read at an instant of ours."""

    ahead_ns: int
    drift_ppm: float
    since_ns: int

    def at(self, local_ns: int) -> int:
        return local_ns + self.offset_at(local_ns)

    def offset_at(self, local_ns: int) -> int:
        return self.ahead_ns + round((local_ns - self.since_ns) * self.drift_ppm * 1e-6)


def exchange(
    estimator: OffsetEstimator, remote: RemoteClock, sent_ns: int, out_ns: int, held_ns: int, back_ns: int
) -> int:
    """One exchange with given delays; when its reply is in."""
    received_ns = sent_ns + out_ns
    replied_ns = received_ns + held_ns
    heard_ns = replied_ns + back_ns
    assert estimator.add(sent_ns, remote.at(received_ns), remote.at(replied_ns), heard_ns)
    return heard_ns


def holds(offset: Offset, remote: RemoteClock, now_ns: int) -> bool:
    return abs(offset.offset_ns - remote.offset_at(now_ns)) <= offset.bound_ns


delays = st.integers(0, 200 * MS)
exchanges = st.lists(
    st.tuples(st.integers(1 * MS, 3 * NS_PER_S), delays, st.integers(0, MS), delays), min_size=1, max_size=60
)


@settings(deadline=None, max_examples=60)
@given(
    ahead_ns=st.integers(-HOUR * 1000, HOUR * 1000),
    drift_ppm=st.floats(-100, 100),
    start_ns=st.integers(0, 1000 * HOUR),
    legs=exchanges,
    later_ns=st.integers(0, 30 * NS_PER_S),
)
def test_the_truth_lies_within_the_bound_whatever_the_delays(
    ahead_ns: int, drift_ppm: float, start_ns: int, legs: list[tuple[int, ...]], later_ns: int
) -> None:
    remote = RemoteClock(ahead_ns, drift_ppm, start_ns)
    estimator = OffsetEstimator(RAW_CLOCKS)
    now_ns = start_ns
    for pause_ns, out_ns, held_ns, back_ns in legs:
        now_ns = exchange(estimator, remote, now_ns + pause_ns, out_ns, held_ns, back_ns)
        assert holds(estimator.estimate(now_ns), remote, now_ns)
    assert holds(estimator.estimate(now_ns + later_ns), remote, now_ns + later_ns)
    assert estimator.steps == 0
    assert estimator.refused == 0


def steady(
    estimator: OffsetEstimator,
    remote: RemoteClock,
    seconds: float,
    out_us: float = 200,
    back_us: float = 200,
    jitter_us: float = 0,
    start_ns: int = 0,
) -> int:
    """Four exchanges a second, with a deterministic jitter of 0 to `jitter_us` on each way."""
    now_ns = start_ns
    for i in range(round(seconds * 4)):
        jitter = jitter_us * (0.5 + 0.5 * math.sin(i * 12.9898) * math.cos(i * 78.233))
        now_ns = start_ns + round(i * 0.25 * NS_PER_S)
        now_ns = exchange(
            estimator,
            remote,
            now_ns,
            round((out_us + jitter) * 1000),
            20_000,
            round((back_us + jitter_us - jitter) * 1000),
        )
    return now_ns


def test_equal_delays_give_the_offset_and_half_the_trip_as_bound() -> None:
    remote = RemoteClock(5 * HOUR, 0.0, 0)
    estimator = OffsetEstimator(RAW_CLOCKS)
    now_ns = steady(estimator, remote, 60)
    offset = estimator.estimate(now_ns)
    assert abs(offset.offset_ns - remote.ahead_ns) < 10
    assert 200_000 <= offset.bound_ns < 201_000
    assert estimator.round_trip_ns == 400_000


def test_one_way_only_is_off_by_exactly_the_bound() -> None:
    remote = RemoteClock(0, 0.0, 0)
    estimator = OffsetEstimator(RateLaw(0.0, 0.0))
    now_ns = exchange(estimator, remote, 0, 10 * MS, 0, 0)
    offset = estimator.estimate(now_ns)
    assert offset.offset_ns == 5 * MS
    assert offset.bound_ns - 5 * MS in range(5)


def test_the_drift_within_a_long_exchange_is_in_the_bound() -> None:
    for drift_ppm in (100.0, -100.0):
        remote = RemoteClock(0, drift_ppm, 0)
        estimator = OffsetEstimator(RAW_CLOCKS)
        # held for 10 s without any delay: by their clock, longer or shorter than we waited
        now_ns = exchange(estimator, remote, 0, 0, 10 * NS_PER_S, 0)
        assert holds(estimator.estimate(now_ns), remote, now_ns)


def test_the_shortest_round_trip_decides() -> None:
    remote = RemoteClock(0, 0.0, 0)
    estimator = OffsetEstimator(RAW_CLOCKS)
    exchange(estimator, remote, 0, 50 * MS, 0, 90 * MS)
    now_ns = exchange(estimator, remote, NS_PER_S, MS, 0, MS)
    good = estimator.estimate(now_ns).bound_ns
    now_ns = exchange(estimator, remote, 2 * NS_PER_S, 50 * MS, 0, 90 * MS)
    assert estimator.estimate(now_ns).bound_ns <= good + 600_000  # a second's drift at 500 ppm


def test_the_drift_is_fitted_and_makes_a_stale_offset_last() -> None:
    remote = RemoteClock(0, 80.0, 0)
    estimator = OffsetEstimator(RAW_CLOCKS)
    now_ns = steady(estimator, remote, 60, out_us=30, back_us=60, jitter_us=100)
    later_ns = now_ns + 20 * NS_PER_S
    offset = estimator.estimate(later_ns)
    assert abs(offset.offset_ns - remote.offset_at(later_ns)) < 150_000  # without the fit: 1.6 ms
    assert holds(offset, remote, later_ns)
    assert offset.bound_ns < 20 * 200_000  # better than the limit of any clock


def test_it_is_trusted_from_the_third_exchange_and_until_it_is_stale() -> None:
    remote = RemoteClock(0, 0.0, 0)
    estimator = OffsetEstimator(stale_after_s=5.0)
    assert estimator.estimate(0) == NEVER_MEASURED
    assert estimator.estimate(0).bound_ns == UNKNOWN_NS
    assert not estimator.estimate(0).trusted
    now_ns = 0
    for i in range(3):
        assert not estimator.estimate(now_ns).trusted
        now_ns = exchange(estimator, remote, i * NS_PER_S, MS, 0, MS)
    assert estimator.estimate(now_ns).trusted
    assert estimator.estimate(now_ns + to_ns(5.0)).trusted
    assert not estimator.estimate(now_ns + to_ns(5.0) + 1).trusted


def test_a_step_of_the_other_clock_begins_anew() -> None:
    estimator = OffsetEstimator(RAW_CLOCKS)
    now_ns = steady(estimator, RemoteClock(0, 0.0, 0), 10)
    stepped = RemoteClock(10 * MS, 0.0, 0)
    now_ns = exchange(estimator, stepped, now_ns + MS, 200_000, 0, 200_000)
    assert estimator.steps == 1
    offset = estimator.estimate(now_ns)
    assert not offset.trusted
    assert holds(offset, stepped, now_ns)
    now_ns = steady(estimator, stepped, 2, start_ns=now_ns)
    assert estimator.steps == 1
    assert estimator.estimate(now_ns).trusted


def test_a_jump_within_the_bounds_is_no_step() -> None:
    estimator = OffsetEstimator(RAW_CLOCKS)
    now_ns = steady(estimator, RemoteClock(0, 0.0, 0), 10)
    exchange(estimator, RemoteClock(300_000, 0.0, 0), now_ns + MS, 200_000, 0, 200_000)
    assert estimator.steps == 0


def test_impossible_stamps_are_refused_and_change_nothing() -> None:
    estimator = OffsetEstimator(RAW_CLOCKS)
    now_ns = steady(estimator, RemoteClock(0, 0.0, 0), 2)
    before = estimator.estimate(now_ns)
    assert not estimator.add(now_ns + 10, now_ns, now_ns, now_ns + 5)  # heard before asked
    assert not estimator.add(now_ns, now_ns + 10, now_ns, now_ns + 5)  # replied before received
    assert not estimator.add(now_ns, now_ns, now_ns + 9000, now_ns + 10)  # held longer than we waited
    assert not estimator.add(0, 0, 1, 2)  # older than what is known
    assert not estimator.add(now_ns + 1, now_ns, now_ns, now_ns)  # heard a nanosecond before asked
    assert estimator.refused == 5
    assert estimator.estimate(now_ns) == before


def test_stamps_convert_both_ways() -> None:
    offset = Offset(1000, 5, trusted=True)
    assert offset.local_ns(5000) == 4000
    assert offset.remote_ns(4000) == 5000


def converse(
    master: MasterExchange,
    slave: SlaveExchange,
    slave_clock: RemoteClock,
    sent_ns: int,
    reply_lost: bool = False,
) -> int:
    """One exchange of messages, 300 µs out and 100 µs back; when the master hears."""
    query = master.query(sent_ns)
    received_ns = sent_ns + 300_000
    replied_ns = received_ns + 20_000
    reply = slave.on_query(query, slave_clock.at(received_ns), slave_clock.at(replied_ns))
    heard_ns = replied_ns + 100_000
    if not reply_lost:
        assert master.on_reply(reply, heard_ns)
    return heard_ns


def test_both_ends_measure_from_the_same_messages() -> None:
    slave_clock = RemoteClock(7 * HOUR, 30.0, 0)
    master, slave = MasterExchange(), SlaveExchange()
    now_ns = 0
    for i in range(40):
        now_ns = converse(master, slave, slave_clock, NS_PER_S + i * NS_PER_S // 4, reply_lost=i % 5 == 4)
    true_ns = slave_clock.offset_at(now_ns)
    on_master = master.estimator.estimate(now_ns)
    on_slave = slave.estimator.estimate(slave_clock.at(now_ns))
    assert on_master.trusted
    assert on_slave.trusted
    assert abs(on_master.offset_ns - true_ns) <= on_master.bound_ns < 300_000
    assert abs(on_slave.offset_ns + true_ns) <= on_slave.bound_ns < 400_000
    assert (master.foreign, slave.foreign) == (0, 0)


def test_a_reply_to_no_question_or_heard_twice_is_ignored() -> None:
    master, slave = MasterExchange(), SlaveExchange()
    query = master.query(1000)
    reply = slave.on_query(query, 5000, 6000)
    assert not master.on_reply(ClockReply(999, 5000, 6000), 2_000_000)
    assert master.on_reply(reply, 2_000_000)
    assert not master.on_reply(reply, 3_000_000)
    assert master.foreign == 2
    assert master.query(4_000_000) == ClockQuery(4_000_000, 1000, 2_000_000)


def test_a_doubled_query_is_measured_by_its_first_reply() -> None:
    slave_clock = RemoteClock(7 * HOUR, 30.0, 0)
    master, slave = MasterExchange(), SlaveExchange()
    now_ns = 0
    for i in range(40):
        query = master.query(NS_PER_S + i * NS_PER_S // 4)
        replies = [
            slave.on_query(query, slave_clock.at(arrived_ns), slave_clock.at(arrived_ns + 20_000))
            for arrived_ns in (query.asked_ns + 300_000, query.asked_ns + 110_000_000)
        ]
        assert master.on_reply(replies[0], query.asked_ns + 420_000)
        now_ns = query.asked_ns + 110_000_000
        assert not master.on_reply(replies[1], now_ns)
    offset = slave.estimator.estimate(slave_clock.at(now_ns))
    assert offset.trusted
    assert abs(offset.offset_ns + slave_clock.offset_at(now_ns)) <= offset.bound_ns < 400_000
    assert slave.estimator.steps == 0


def test_a_question_is_forgotten_after_sixteen_more() -> None:
    master = MasterExchange()
    queries = [master.query(i * 1000) for i in range(17)]
    assert not master.on_reply(ClockReply(queries[0].asked_ns, 1, 2), 20_000)
    assert master.on_reply(ClockReply(queries[1].asked_ns, 1, 2), 20_000)


def test_another_asker_is_answered_but_not_measured() -> None:
    slave_clock = RemoteClock(0, 0.0, 0)
    master, stranger, slave = MasterExchange(), MasterExchange(), SlaveExchange()
    now_ns = 0
    for i in range(20):
        now_ns = converse(master, slave, slave_clock, NS_PER_S + i * NS_PER_S // 4)
        # the stranger's clock is an hour ahead of the master's
        reply = slave.on_query(stranger.query(now_ns + HOUR), now_ns, now_ns)
        assert stranger.on_reply(reply, now_ns + HOUR + MS)
    offset = slave.estimator.estimate(now_ns)
    assert offset.trusted
    assert abs(offset.offset_ns) <= offset.bound_ns
    assert slave.foreign == 20
    assert slave.estimator.steps == 0


def test_after_a_second_of_silence_the_next_asker_is_followed() -> None:
    first, slave = MasterExchange(), SlaveExchange()
    now_ns = 0
    for i in range(20):
        now_ns = converse(first, slave, RemoteClock(0, 0.0, 0), NS_PER_S + i * NS_PER_S // 4)
    second, ahead_ns = MasterExchange(), HOUR
    second_sees_slave = RemoteClock(-ahead_ns, 0.0, 0)
    start_ns = now_ns + NS_PER_S + 1
    for i in range(5):
        converse(second, slave, second_sees_slave, start_ns + ahead_ns + i * NS_PER_S // 4)
    now_ns = start_ns + 2 * NS_PER_S
    offset = slave.estimator.estimate(now_ns)
    assert slave.estimator.steps == 1
    assert offset.trusted
    assert abs(offset.offset_ns - ahead_ns) <= offset.bound_ns


def test_the_asker_who_is_followed_is_measured_not_the_first_one() -> None:
    waiting, holder, slave = MasterExchange(asker=7), MasterExchange(asker=8), SlaveExchange()
    holder_ahead_ns = HOUR
    for i in range(1, 21):
        now_ns = converse(waiting, slave, RemoteClock(0, 0.0, 0), i * NS_PER_S // 4)
        converse(holder, slave, RemoteClock(-holder_ahead_ns, 0.0, 0), now_ns + holder_ahead_ns)
    slave.follow(8)
    now_ns += 10 * MS
    offset = slave.estimator.estimate(now_ns)
    assert offset.trusted
    assert abs(offset.offset_ns - holder_ahead_ns) <= offset.bound_ns
    slave.follow(9)
    assert not slave.estimator.estimate(now_ns).trusted


def test_many_askers_never_drive_out_the_one_that_is_followed() -> None:
    master, slave = MasterExchange(asker=7), SlaveExchange()
    slave.follow(7)
    for i in range(1, 9):
        now_ns = converse(master, slave, RemoteClock(0, 0.0, 0), i * NS_PER_S // 4)
    for asker in range(100, 100 + 3 * MOST_ASKERS):
        slave.on_query(ClockQuery(1, asker=asker), now_ns, now_ns)
    assert slave.estimator.estimate(now_ns).trusted
    assert len(slave._askers) == MOST_ASKERS
    assert slave.foreign == 3 * MOST_ASKERS


@given(st.integers(0, 2**63 - 1), st.integers(0, 2**63 - 1), st.integers(0, 2**63 - 1))
def test_foreign_stamps_do_not_move_the_estimate(first: int, second: int, third: int) -> None:
    slave_clock = RemoteClock(0, 0.0, 0)
    master, slave = MasterExchange(), SlaveExchange()
    now_ns = 0
    for i in range(1, 9):
        now_ns = converse(master, slave, slave_clock, NS_PER_S + i * NS_PER_S // 4)
    before = master.estimator.estimate(now_ns), slave.estimator.estimate(now_ns)
    asked = {NS_PER_S + i * NS_PER_S // 4 for i in range(1, 9)}
    if first not in asked:
        master.on_reply(ClockReply(first, second, third), now_ns)
    if second not in asked:
        slave.on_query(ClockQuery(first, second, third), now_ns, now_ns)
    assert (master.estimator.estimate(now_ns), slave.estimator.estimate(now_ns)) == before
