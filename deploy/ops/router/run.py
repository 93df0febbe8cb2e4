"""Routes until stopped. Connections are logged by certificate name; refusals are counted."""

from __future__ import annotations

import asyncio
import json
import logging

from common.clock import NS_PER_S, monotonic_ns
from common.link.audit import Audit
from common.link.link_session import LinkSession
from common.link.revoked import RevocationFile
from common.link.router import RouterConfig
from common.link.session import open_session
from common.link.zenoh_config import zenoh_configuration
from common.metrics.tree import WriteMetrics
from common.process.notify import Notifier, open_notifier
from common.process.pacing import TickGrid
from common.process.runtime import until_stopped
from common.process.ticker import ticks

log = logging.getLogger(__name__)


def zenohd_configuration(config: RouterConfig) -> dict[str, object]:
    """What `zenohd --config` reads: the same endpoints, keys and rules, without this process around them."""
    listed = config.link.revoked
    revoked = RevocationFile(listed).names if listed else frozenset()
    return zenoh_configuration(config.link, "router", revoked)


def zenohd_text(config: RouterConfig) -> str:
    """The same as a file."""
    head = (
        f"// Made by `tandem router --zenohd` for {config.name}; change the TOML and make it again.\n"
        "// zenohd reads no revocation list: after each revocation make this file again and restart zenohd.\n"
        "// Rules are by certificates' common names: see docs/security.md.\n"
    )
    return head + json.dumps(zenohd_configuration(config), indent=2) + "\n"


async def run(config: RouterConfig, stop: asyncio.Event, write_metrics: WriteMetrics) -> None:
    """Route until `stop` is set. Raises LinkError where it cannot listen."""
    if config.link.tls is None:
        log.warning("no [link.tls]: anyone who reaches this router may command every robot at it")
    # an address that is not there yet is waited for, so what stops the router must reach it then too
    await until_stopped(stop, _route(config, write_metrics))
    log.info("stopped")


async def _route(config: RouterConfig, write_metrics: WriteMetrics) -> None:
    notifier = open_notifier()
    audit = Audit(config.link)
    async with open_session(config.link, "router", waits=notifier.waits) as session:
        audit.attach(session)
        log.info("%s: routing at %s", config.name, ", ".join(config.link.listen))
        try:
            await tend(session, notifier)
        finally:
            notifier.stopping()
            write_metrics(audit.metrics())


async def tend(session: LinkSession, notifier: Notifier) -> None:
    """Tell the service manager that Zenoh itself still answers: it routes in threads of its own."""
    async for _ in ticks(TickGrid(monotonic_ns(), NS_PER_S)):
        connected = session.peers  # were Zenoh hung this would not return, and nobody would beat
        notifier.status(f"{connected} connected")
        notifier.beat(monotonic_ns())
