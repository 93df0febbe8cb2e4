"""Opens a Zenoh session: at once between peers; through routers once one of them answers."""

from __future__ import annotations

import asyncio
import json
import logging
import math
import re
import threading
from collections.abc import Callable

import zenoh

from common.config import LinkConfig
from common.errors import LinkError
from common.link.configuration import zenoh_configuration

RETRY_S = 0.5
_RUST_PLACE = re.compile(r"[!.]?\s+at \S+\.rs:\d+\.?")
_NO_ROUTER = "Unable to connect to any of"

log = logging.getLogger(__name__)


async def open_zenoh(
    config: LinkConfig,
    mode: str = "",
    within_s: float = math.inf,
    waits: Callable[[str], None] = lambda _: None,
) -> zenoh.Session:
    """The session. As a client it waits `within_s` for its router, and says so. Raises LinkError."""
    turn, until_s = 0, asyncio.get_running_loop().time() + within_s
    while True:
        try:
            return await _open_off_the_loop(_in_turn(config, turn), mode)
        except zenoh.ZError as error:
            if config.mode != "client" or _NO_ROUTER not in str(error):
                raise LinkError(f"the link cannot be opened: {_RUST_PLACE.sub('', str(error))}") from None
        routers = ", ".join(config.connect)
        if asyncio.get_running_loop().time() >= until_s:
            raise LinkError(f"no router answered at {routers} within {within_s:g} s")
        waits(f"waits for a router at {routers}")
        if turn == 0:
            log.warning("no router answers at %s: tried until one does", routers)
        turn += 1
        await asyncio.sleep(RETRY_S)


def _in_turn(config: LinkConfig, turn: int) -> LinkConfig:
    """Another endpoint first each time: a client whose first router is dead does not try the second."""
    if config.mode != "client":
        return config
    first = turn % len(config.connect)
    return config.model_copy(update={"connect": [*config.connect[first:], *config.connect[:first]]})


async def _open_off_the_loop(config: LinkConfig, mode: str) -> zenoh.Session:
    settings = zenoh.Config.from_json5(json.dumps(zenoh_configuration(config, mode)))
    opening = asyncio.ensure_future(asyncio.to_thread(zenoh.open, settings))
    try:
        return await asyncio.shield(opening)
    except asyncio.CancelledError:
        opening.add_done_callback(_close_unwanted)
        raise


def _close_unwanted(opening: asyncio.Future[zenoh.Session]) -> None:
    if not opening.cancelled() and opening.exception() is None:
        # this is called on the loop, and to close can take ten seconds
        threading.Thread(target=_close, args=(opening.result(),), name="link-close", daemon=True).start()


def _close(session: zenoh.Session) -> None:
    try:
        session.close()
    except Exception as error:  # nobody wants it any more
        log.debug("close: %s", error)
