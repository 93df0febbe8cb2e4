"""The simulated suit's process: answers on CAN, publishes the truth, takes faults over the link."""

from __future__ import annotations

import asyncio
import logging
import tomllib
from collections.abc import Callable
from contextlib import AsyncExitStack
from pathlib import Path

from common.config.load import check_config
from common.errors import ConfigError, ConfigMistake
from common.link import Link, open_link
from common.metrics.tree import WriteMetrics
from common.wire.codec import encode
from common.wire.messages import Truth
from common.wire.topics import FAULTS, TRUTH
from deploy.sim.suit.app import run as answer
from deploy.sim.suit.config import SuitConfig
from deploy.sim.suit.faults import FaultsConfig
from deploy.sim.suit.suit import SimulatedSuit

log = logging.getLogger(__name__)


async def run(config: SuitConfig, stop: asyncio.Event, write_metrics: WriteMetrics) -> None:
    """Answer until `stop` is set. Without a link the truth is not published."""
    async with AsyncExitStack() as stack:
        link: Link | None = None
        publish_truth: Callable[[Truth], None] | None = None
        if config.link.connect or config.link.listen:
            link = await stack.enter_async_context(open_link(config.link, config.robot))
            put = link.publish(TRUTH)
            publish_truth = lambda truth: put(encode(truth))  # noqa: E731

        def on_suit(suit: SimulatedSuit) -> None:
            if link is not None:
                link.answer(FAULTS, lambda payload, _: _take(payload, config, suit))

        write_metrics(await answer(config, stop, publish_truth, on_suit))


def _take(payload: bytes, config: SuitConfig, suit: SimulatedSuit) -> bytes:
    suit.faults.config = requested_faults(payload, list(config.nodes))
    log.info("injected sensor faults: %s", suit.faults.config.model_dump(exclude_defaults=True) or "none")
    return b"done"


def requested_faults(payload: bytes, nodes: list[str]) -> FaultsConfig:
    """The faults that a test asks for, written as in the file's `[faults]`. Raises ConfigError."""
    where = Path("requested faults")
    try:
        table = tomllib.loads(payload.decode("utf-8"))
    except (UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        mistake = ConfigMistake("faults", payload[:80], f"valid TOML ({error})")
        raise ConfigError(where, [mistake]) from None
    faults = check_config(where, table, FaultsConfig)
    if mistakes := faults.unknown_nodes(nodes):
        raise ConfigError(where, mistakes)
    return faults
