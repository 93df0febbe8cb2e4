"""Where a process that only observes listens: endpoints, or the `[link]` of a file of its own."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from common.config.load import load_config
from common.config.section import Section
from common.link.config import LinkConfig
from deploy.client.destination import destination


class ObserverConfig(Section):
    """The TOML file of a process that only observes."""

    link: LinkConfig


def link_of(connect: Sequence[str], file: Path | None) -> LinkConfig:
    """Where to listen in: the endpoints, or the file's `[link]`. Raises ConfigError, TandemError."""
    if file is not None:
        return load_config(file, ObserverConfig).link
    return destination(connect, None).link
