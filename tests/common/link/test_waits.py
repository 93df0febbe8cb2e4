"""A client whose router does not answer says so until it does: it is not to be restarted for that."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest
import zenoh

from common.errors import LinkError
from common.link import opening
from common.link.config import LinkConfig
from common.process.notify import STARTS_WITHIN_S

ROUTER = "tcp/127.0.0.1:1"


def opened(
    monkeypatch: pytest.MonkeyPatch, mode: str, failures: int, words: str = "Unable to connect to any of [..]"
) -> tuple[Any, list[str]]:
    """What came of it, and what was said; Zenoh refuses so often."""
    left, said = [failures], list[str]()

    async def attempt(*_: object) -> object:
        left[0] -= 1
        if left[0] >= 0:
            raise zenoh.ZError(words)
        return "a session"

    monkeypatch.setattr(opening, "_open_off_the_loop", attempt)
    monkeypatch.setattr(opening, "RETRY_S", 0.0)
    listen = [ROUTER] if mode == "listens" else []
    config = LinkConfig(connect=[ROUTER], mode="client" if mode == "client" else "peer", listen=listen)
    return asyncio.run(opening.open_zenoh(config, waits=said.append)), said


def test_each_attempt_that_finds_no_router_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    assert opened(monkeypatch, "client", 3) == ("a session", [f"waiting: no router answered at {ROUTER}"] * 3)


def test_one_that_answers_at_once_is_not_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    assert opened(monkeypatch, "client", 0) == ("a session", [])


ABSENT = "Can not create a new TCP listener bound to tcp/x: [x: Cannot assign requested address (os error 99)"
NO_DNS = "failed to lookup address information: Temporary failure in name resolution"


@pytest.mark.parametrize("words", [ABSENT, NO_DNS, "lookup: Name or service not known"])
def test_an_address_that_the_host_does_not_have_yet_is_waited_for(
    monkeypatch: pytest.MonkeyPatch, words: str
) -> None:
    session, said = opened(monkeypatch, "listens", 4, words)
    assert session == "a session"
    assert len(said) == 4
    assert said[0].startswith(f"waiting: this host cannot listen at {ROUTER} yet")


def test_it_is_looked_for_ever_more_rarely(monkeypatch: pytest.MonkeyPatch) -> None:
    pauses: list[float] = []
    real = asyncio.sleep

    async def sleep(seconds: float) -> None:
        pauses.append(seconds)
        await real(0)

    monkeypatch.setattr(asyncio, "sleep", sleep)
    left = [12]

    async def attempt(*_: object) -> object:
        left[0] -= 1
        if left[0] >= 0:
            raise zenoh.ZError(ABSENT)
        return "a session"

    monkeypatch.setattr(opening, "_open_off_the_loop", attempt)
    asyncio.run(opening.open_zenoh(LinkConfig(listen=[ROUTER])))
    assert pauses[0] == opening.RETRY_S
    assert pauses == sorted(pauses)
    assert pauses[-1] == opening.MOST_RETRY_S < STARTS_WITHIN_S  # the start's time-out never passes between


def test_a_person_does_not_wait_for_ever(monkeypatch: pytest.MonkeyPatch) -> None:
    async def attempt(*_: object) -> object:
        raise zenoh.ZError(ABSENT)

    monkeypatch.setattr(opening, "_open_off_the_loop", attempt)
    with pytest.raises(LinkError, match=r"cannot listen at .* yet .* within 0 s"):
        asyncio.run(opening.open_zenoh(LinkConfig(listen=[ROUTER]), within_s=0.0))


@pytest.mark.parametrize(
    ("mode", "words"),
    [
        ("client", "bad key"),
        ("client", "os error 99"),
        ("peer", "Unable to connect to any of"),
        ("listens", "Address already in use"),
        ("listens", "Permission denied"),
    ],
)
def test_what_no_waiting_mends_ends_it(monkeypatch: pytest.MonkeyPatch, mode: str, words: str) -> None:
    with pytest.raises(LinkError, match=words):
        opened(monkeypatch, mode, 1, words)


def test_a_client_gives_a_slow_line_more_time_in_every_second_round(monkeypatch: pytest.MonkeyPatch) -> None:
    tried: list[tuple[str, float]] = []

    async def attempt(settings: Any) -> object:
        seconds = settings["transport"]["unicast"]["open_timeout"] / 1e3
        tried.append((settings["connect"]["endpoints"][0], seconds))
        if len(tried) < 6:
            raise zenoh.ZError("Unable to connect to any of [..]")
        return "a session"

    monkeypatch.setattr(opening, "_open_off_the_loop", attempt)
    monkeypatch.setattr(opening, "RETRY_S", 0.0)
    other = "tcp/127.0.0.1:2"
    config = LinkConfig(connect=[ROUTER, other], mode="client", open_timeout_s=4.0)
    asyncio.run(opening.open_zenoh(config))
    assert tried == [(ROUTER, 4.0), (other, 4.0), (ROUTER, 10.0), (other, 10.0), (ROUTER, 4.0), (other, 4.0)]
    tried.clear()
    asyncio.run(opening.open_zenoh(config, within_s=5.0))
    assert {seconds for _, seconds in tried} == {4.0}, "a person's question does not wait so long"
