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
