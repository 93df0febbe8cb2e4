"""The router's TOML file: its [link] has the form of every other host's."""

from __future__ import annotations

from pydantic import Field

from common.config.section import Section
from common.errors import ConfigMistake
from common.link.config import LinkConfig


class RouterConfig(Section):
    """The whole file."""

    name: str = Field("router", pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]{0,47}$")
    link: LinkConfig

    def mistakes(self) -> list[ConfigMistake]:
        """A router listens; it is no client of another."""
        found = self.link.mistakes()
        if not self.link.listen:
            found.append(ConfigMistake("link.listen", [], "an endpoint where masters and robots connect"))
        if self.link.mode == "client":
            found.append(ConfigMistake("link.mode", "client", "no mode: it is a router"))
        return found
