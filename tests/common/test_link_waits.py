"""A client whose router does not answer says so until it does: it is not to be restarted for that."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest
import zenoh

from common.config import LinkConfig
from common.errors import LinkError
from common.link import opening

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
    config = LinkConfig(connect=[ROUTER], mode=mode)
    return asyncio.run(opening.open_zenoh(config, waits=said.append)), said


def test_each_attempt_that_finds_no_router_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    assert opened(monkeypatch, "client", 3) == ("a session", [f"waits for a router at {ROUTER}"] * 3)


def test_one_that_answers_at_once_is_not_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    assert opened(monkeypatch, "client", 0) == ("a session", [])


@pytest.mark.parametrize(("mode", "words"), [("client", "bad key"), ("peer", "Unable to connect to any of")])
def test_what_no_waiting_mends_ends_it(monkeypatch: pytest.MonkeyPatch, mode: str, words: str) -> None:
    with pytest.raises(LinkError, match=words):
        opened(monkeypatch, mode, 1, words)
