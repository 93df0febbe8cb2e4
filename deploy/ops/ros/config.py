"""The TOML file of the bridge: an observer's `[link]`."""

from __future__ import annotations

from common.config.section import Section
from common.link.config import LinkConfig


class BridgeConfig(Section):
    """Only where the robot is, and this host's keys."""

    link: LinkConfig
