"""Wait until the other side is there."""

from __future__ import annotations

import asyncio

import zenoh
from zenoh.handlers import Callback

from common.errors import LinkTimeoutError
from common.link.inbox import wake


def count_peers(session: zenoh.Session) -> int:
    """How many sessions this one is connected to now: peers, routers, clients."""
    return len(session.info.transports())


def paths_in_words(session: zenoh.Session) -> str:
    """Which of two paths does not carry; empty where both do, none does, or where there is one."""
    words: str = getattr(session, "words", "")
    return words


async def wait_for_peer(session: zenoh.Session, key: str | None, timeout_s: float) -> None:
    """Until another session is connected and, where a key is given, one that answers it.

    A session is connected a millisecond before it has declared what it answers: a question put in between
    would find no answerer. Raises LinkTimeoutError.
    """
    loop = asyncio.get_running_loop()
    there = asyncio.Event()

    def on_change(_: object) -> None:
        wake(loop, there.set)

    handler: Callback[object] = Callback(on_change, indirect=False)
    try:
        async with asyncio.timeout(timeout_s):
            if key is None:
                events = session.info.declare_transport_events_listener(handler, history=True)
                try:
                    await there.wait()
                finally:
                    events.undeclare()
                return
            querier = session.declare_querier(key, allowed_destination=zenoh.Locality.REMOTE)
            try:
                querier.declare_matching_listener(handler)
                while not is_matching(querier.matching_status):
                    there.clear()
                    await there.wait()
            finally:
                querier.undeclare()
    except TimeoutError:
        what = "another session" if key is None else f"anyone who answers {key}"
        raise LinkTimeoutError(f"no link to {what} within {timeout_s:g} s") from None


def is_matching(status: object) -> bool:
    """Whether a publisher has subscribers, or a querier somebody who answers."""
    # declared as a flag, but an object that holds one comes
    return bool(getattr(status, "matching", status))
