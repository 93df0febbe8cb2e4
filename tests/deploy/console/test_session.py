"""Who may: tokens are used once, sessions end, foreign hosts and origins are refused."""

from __future__ import annotations

import itertools

import pytest

from common.clock import to_ns
from deploy.console.session import SESSION_S, TOKEN_S, Access, PageRole, Person, RateLimit

NURSE = Person(PageRole.OPERATOR, "nurse-1")
SELF = "127.0.0.1:8080"


def access(secure: bool = False, stranger: PageRole = PageRole.VIEWER) -> Access:
    numbers = itertools.count(1)
    return Access([SELF, "localhost:8080"], secure, stranger, lambda: f"secret-{next(numbers)}")


def test_a_token_logs_in_once() -> None:
    doors = access()
    token = doors.issue(NURSE, 0)
    secret, person = doors.log_in(token, 1) or ("", Person(PageRole.VIEWER))
    assert person == NURSE
    assert doors.person(secret, 2) == NURSE
    assert doors.log_in(token, 3) is None
    assert doors.log_in("secret-9", 3) is None
    assert doors.log_in("", 3) is None


def test_a_token_and_a_session_end() -> None:
    doors = access()
    old, fresh = doors.issue(NURSE, 0), doors.issue(NURSE, 0)
    assert doors.log_in(old, to_ns(TOKEN_S) + 1) is None
    found = doors.log_in(fresh, to_ns(TOKEN_S))
    assert found is not None
    began_ns = to_ns(TOKEN_S)
    assert doors.person(found[0], began_ns + to_ns(SESSION_S)).role is PageRole.OPERATOR
    assert doors.person(found[0], began_ns + to_ns(SESSION_S) + 1).role is PageRole.VIEWER


def test_tokens_that_are_too_old_are_not_kept() -> None:
    doors = access()
    for day in range(10):
        doors.issue(NURSE, day * to_ns(86400.0))
    assert len(doors._tokens) == 1


def test_who_logs_out_is_a_stranger() -> None:
    doors = access(stranger=PageRole.NOBODY)
    found = doors.log_in(doors.issue(NURSE, 0), 1)
    assert found is not None
    doors.log_out(found[0])
    assert doors.person(found[0], 2).role is PageRole.NOBODY


@pytest.mark.parametrize(
    "host", ["evil.example", "127.0.0.1", "127.0.0.1:81", "", "localhost:8080.evil.example"]
)
def test_another_hosts_name_is_refused_and_counted(host: str) -> None:
    doors = access()
    assert doors.wrong_host(host)
    assert doors.refused == {"host": 1}
    assert not doors.wrong_host("LocalHost:8080")


@pytest.mark.parametrize(
    "origin",
    [
        "",
        "null",
        "http://evil.example",
        "https://127.0.0.1:8080",
        "http://127.0.0.1",
        "http://localhost:8080",
    ],
)
def test_another_origin_is_refused_also_by_another_name_of_this_host(origin: str) -> None:
    doors = access()
    assert doors.wrong_origin(origin, SELF)
    assert doors.refused == {"origin": 1}
    assert not doors.wrong_origin(f"http://{SELF}", SELF)
    assert not access(secure=True).wrong_origin(f"https://{SELF}", SELF)


def test_a_rate_is_a_second_s_worth_at_once_and_then_as_many_as_it_says() -> None:
    rate = RateLimit(20.0)
    assert [rate.passes(0) for _ in range(21)].count(True) == 20
    assert not rate.passes(to_ns(0.049))
    assert rate.passes(to_ns(0.051))
    assert not rate.passes(to_ns(0.052))


@pytest.mark.parametrize(
    ("role", "sees", "acts"),
    [("nobody", False, False), ("viewer", True, False), ("operator", True, True), ("engineer", True, True)],
)
def test_roles(role: str, sees: bool, acts: bool) -> None:
    assert (PageRole(role).sees, PageRole(role).acts) == (sees, acts)
