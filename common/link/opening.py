"""Opens a Zenoh session; what the host or its network does not have yet is waited for."""

from __future__ import annotations

import asyncio
import json
import logging
import math
import re
import threading
from collections.abc import Callable

import zenoh

from common.errors import LinkError
from common.link.config import LinkConfig
from common.link.zenoh_config import zenoh_configuration

RETRY_S = 0.5
MOST_RETRY_S = 5.0
"""Between two attempts, which begin RETRY_S apart and grow rarer."""
BACK_OFF = 1.5
PATIENT, MOST_PATIENT_S = 3.0, 10.0
"""An attempt in the second of two rounds over the routers may last longer: perhaps the line is slow."""
_RUST_PLACE = re.compile(r"[!.]?\s+at \S+\.rs:\d+\.?")
_NO_ROUTER = "Unable to connect to any of"
_NOT_YET = re.compile(
    r"\(os error (?:19|99|100|101)\)"  # no such device, address not available, network down or unreachable
    r"|Name or service not known|Temporary failure in name resolution|No address associated with hostname"
)
"""Of an endpoint that this host may have a little later: an interface that is not up, a name without DNS."""

log = logging.getLogger(__name__)


async def open_zenoh(
    config: LinkConfig,
    mode: str = "",
    within_s: float = math.inf,
    waits: Callable[[str], None] = lambda _: None,
    revoked: frozenset[str] = frozenset(),
) -> zenoh.Session:
    """The session. It waits `within_s` for what the host does not have yet, and logs it. Raises LinkError.

    A client waits for its router; a session that listens waits for its address or host name.
    """
    turn, until_s = 0, asyncio.get_running_loop().time() + within_s
    pause_s = RETRY_S
    while True:
        try:
            trying = in_turn(config, turn, patient=math.isinf(within_s))
            return await _open_off_the_loop(zenoh_configuration(trying, mode, revoked))
        except zenoh.ZError as error:
            words = _RUST_PLACE.sub("", str(error))
        missing = _missing(config, words)
        if missing is None:
            raise LinkError(f"the link cannot be opened: {words}") from None
        if asyncio.get_running_loop().time() >= until_s:
            raise LinkError(f"{missing} within {within_s:g} s")
        waits(f"waiting: {missing}")
        if turn == 0:
            log.warning("%s: retrying, at least every %g s", missing, MOST_RETRY_S)
        turn += 1
        await asyncio.sleep(pause_s)
        # a router is looked for as often as before: each attempt lasts a while by itself
        pause_s = RETRY_S if config.mode == "client" else min(MOST_RETRY_S, BACK_OFF * pause_s)


def _missing(config: LinkConfig, words: str) -> str | None:
    """What this host or its network does not have yet, in words; None where waiting would not help."""
    if config.mode == "client" and _NO_ROUTER in words:
        return f"no router answered at {', '.join(config.connect)}"
    if config.listen and _NOT_YET.search(words):
        why = words.rpartition(": ")[2].strip("[]")
        return f"this host cannot listen at {', '.join(config.listen)} yet ({why})"
    return None


def in_turn(config: LinkConfig, turn: int, patient: bool = True) -> LinkConfig:
    """What a client tries in its turn: each endpoint first once a round, as it never tries the second itself.

    `patient`: every second round lasts longer, so that a line which is slower than `open_timeout_s` is
    opened too.
    """
    if config.mode != "client":
        return config
    rounds, first = divmod(turn, len(config.connect))
    changed: dict[str, object] = {"connect": [*config.connect[first:], *config.connect[:first]]}
    if patient and rounds % 2:
        slow_s = min(MOST_PATIENT_S, PATIENT * config.open_timeout_s)
        changed["open_timeout_s"] = max(config.open_timeout_s, slow_s)
    return config.model_copy(update=changed)


async def open_once(config: LinkConfig, revoked: frozenset[str] = frozenset()) -> zenoh.Session:
    """One attempt, without waiting for anything. Raises ZError; if cancelled, the session is closed."""
    return await _open_off_the_loop(zenoh_configuration(config, "", revoked))


async def _open_off_the_loop(tree: dict[str, object]) -> zenoh.Session:
    settings = zenoh.Config.from_json5(json.dumps(tree))
    opening = asyncio.ensure_future(asyncio.to_thread(zenoh.open, settings))
    try:
        return await asyncio.shield(opening)
    except asyncio.CancelledError:
        opening.add_done_callback(close_unwanted)
        raise


def close_unwanted(opening: asyncio.Future[zenoh.Session]) -> None:
    """Close a session that has opened and that nobody uses; one that did not open needs nothing."""
    if not opening.cancelled() and opening.exception() is None:
        # this is called on the loop, and to close can take ten seconds
        threading.Thread(target=_close, args=(opening.result(),), name="link-close", daemon=True).start()


def _close(session: zenoh.Session) -> None:
    try:
        session.close()
    except Exception as error:  # it was given up already
        log.debug("error while closing the session: %s", error)
