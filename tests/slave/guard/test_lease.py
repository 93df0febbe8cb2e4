from itertools import count

import pytest

from slave.guard.lease import Lease, random_token

S = 1_000_000_000


@pytest.fixture
def lease() -> Lease:
    tokens = count(1)
    return Lease(S, lambda: next(tokens))


def test_the_first_to_claim_gets_it(lease: Lease) -> None:
    token = lease.claim("anna", 0)
    assert (token, lease.token, lease.operator) == (1, 1, "anna")
    assert lease.operator == "anna"
    assert lease.token


@pytest.mark.parametrize("who", ["ben", "anna"])
def test_a_live_lease_is_never_stolen_not_even_by_its_own_name(lease: Lease, who: str) -> None:
    lease.claim("anna", 0)
    assert lease.claim(who, S) == 0
    assert (lease.token, lease.operator) == (1, "anna")


@pytest.mark.parametrize("who", ["ben", "anna"])
def test_a_lapsed_lease_is_granted_anew_with_another_token(lease: Lease, who: str) -> None:
    lease.claim("anna", 0)
    assert lease.claim(who, S + 1) == 2
    assert lease.operator == who


def test_it_lapses_just_after_its_time_out(lease: Lease) -> None:
    lease.claim("anna", 0)
    assert not lease.lapse(S)
    assert lease.lapse(S + 1)
    assert (lease.token, lease.operator) == (0, "")


def test_renewal_counts_anew_from_arrival(lease: Lease) -> None:
    lease.claim("anna", 0)
    lease.renew(S // 2)
    assert not lease.lapse(S + S // 2)
    assert lease.lapse(S + S // 2 + 1)


def test_an_earlier_arrival_does_not_shorten_it(lease: Lease) -> None:
    lease.claim("anna", S)
    lease.renew(S // 2)
    assert not lease.lapse(2 * S)


def test_a_lapsed_lease_does_not_revive_when_the_clock_returns(lease: Lease) -> None:
    lease.claim("anna", 100 * S)
    assert lease.lapse(50 * S)
    lease.renew(50 * S)
    assert lease.token == 0
    assert not lease.lapse(100 * S)
    assert lease.token == 0


def test_dropping_frees_it(lease: Lease) -> None:
    lease.claim("anna", 0)
    lease.drop()
    assert lease.operator == ""
    assert lease.claim("ben", 0) == 2


def test_nobody_without_a_name_holds_it(lease: Lease) -> None:
    assert lease.claim("", 0) == 0
    assert lease.token == 0


def test_tokens_cannot_be_guessed_and_are_never_zero() -> None:
    drawn = {random_token() for _ in range(1000)}
    assert len(drawn) == 1000
    assert all(0 < token < 2**63 for token in drawn)


def offered(lease: Lease, at_ns: int = 0) -> Lease:
    lease.claim("anna", at_ns)
    lease.offer("ben", at_ns)
    return lease


def test_only_the_one_to_whom_it_is_offered_takes_it(lease: Lease) -> None:
    offered(lease)
    for who in ("carl", "anna", "", "Ben"):
        assert lease.claim(who, 1) == 0
    assert (lease.token, lease.operator, lease.offered_to) == (1, "anna", "ben")
    assert lease.claim("ben", 1) == 2
    assert (lease.token, lease.operator, lease.offered_to) == (2, "ben", "")
    assert lease.claim("ben", 1) == 0, "an offer is taken once"


def test_an_offer_lapses_just_after_its_time_out_and_the_lease_does_not() -> None:
    for late_ns, token in ((0, 2), (1, 0)):
        lease = offered(Lease(100 * S, count(1).__next__, offer_timeout_ns=60 * S))
        lease.offer("ben", S)
        assert lease.lapse_offer(61 * S) == ""
        assert lease.claim("ben", 61 * S + late_ns) == token
        assert lease.operator == ("ben" if token else "anna")
    assert lease.lapse_offer(62 * S) == ""
    lease.offer("ben", 62 * S)
    assert lease.lapse_offer(62 * S - 60 * S - 1) == "ben", "a clock that went back ends it too"
    assert lease.offered_to == ""


def test_the_newest_offer_counts_and_ends_with_the_lease_or_by_word(lease: Lease) -> None:
    offered(lease)
    lease.offer("carl", 1)
    assert lease.claim("ben", 1) == 0
    lease.withdraw()
    assert lease.claim("carl", 1) == 0
    lease.offer("carl", 1)
    assert lease.lapse(S + 1)
    assert lease.offered_to == ""
    assert lease.claim("dora", S + 1) == 2


def test_an_offer_is_told(lease: Lease) -> None:
    lease.claim("anna", 0)
    metrics = lease.metrics(S)
    assert metrics is not None
    assert (metrics.offered_to, metrics.offer_left_s) == ("", 0.0)
    lease.offer("ben", 0)
    metrics = lease.metrics(S)
    assert metrics is not None
    assert (metrics.offered_to, metrics.offer_left_s) == ("ben", 59.0)
