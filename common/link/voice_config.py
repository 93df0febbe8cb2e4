"""`[voice]`: the operator and the person at the robot talk with each other."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from common.config.section import Section
from common.link.config import Endpoint


class VoiceConfig(Section):
    """`[voice]` of the master's and of the slave's TOML. Both must allow it."""

    enabled: bool = False
    """Whether `tandem voice` may listen and speak here."""
    listen: list[Endpoint] = Field(default_factory=list)
    """At the robot: where the operator's `tandem voice` reaches this one. None is needed with a router."""
    connect: list[Endpoint] = Field(default_factory=list)
    """At the operator: the robot's `listen`, beside the endpoints of [link]."""
    starts: Literal["muted", "open"] = "muted"
    """The microphone at the start; Enter changes it."""
    microphone: str = ""
    """Part of the sound device's name; empty: the host's own choice. `null`: none, for tests."""
    speaker: str = ""
    """As `microphone`."""
    echo_cancelling: bool = True
    """Take out of the microphone what the speaker plays. Off: only with headphones."""
