"""`[operator.deadman]` and `[operator.clutch]`: what the operator holds while the robot is to follow."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BeforeValidator, Field

from common.config.section import RelativePath, Section
from common.inputs.config import KeyConfig


class AlwaysHeld(Section):
    """No pedal: the commands always count as wanted. There is no default, so that a person decides it."""

    source: Literal["always_held"]


class Pedal(KeyConfig):
    """A key of a Linux input device: a foot pedal, a button, a gamepad."""

    source: Literal["pedal"]


class CanButton(Section):
    """A bit of a frame on one of the suit's buses: a button on the glove."""

    source: Literal["can"]
    bus: str = Field(min_length=1)
    """The name of one of `[[capture.buses]]`."""
    message: str = Field("BUTTONS", min_length=1)
    """The frame, by its name in the DBC of `[capture]`."""
    signal: str = Field(min_length=1)
    """Its signal that is not 0 while the button is pressed."""
    timeout_s: float = Field(0.1, gt=0.0, le=1.0)
    """Without a good frame for longer than this, by arrival, the button counts as released."""


class ConsoleHold(Section):
    """A key or a pedal that somebody holds on a page of `tandem console`, on this host."""

    source: Literal["console"]
    socket: RelativePath
    """Where the console's beats come in, such as /run/tandem/deadman.sock."""
    timeout_s: float = Field(0.3, ge=0.1, le=0.5)
    """Without a fresh beat for longer than this, by arrival, it counts as released. Beats come each 50 ms."""


def _known(value: object) -> object:
    if isinstance(value, str):
        raise ValueError(f'expected its new form: [operator.deadman] with source = "{value}"')
    return value


DeadmanConfig = Annotated[
    AlwaysHeld | Pedal | CanButton | ConsoleHold, Field(discriminator="source"), BeforeValidator(_known)
]
ClutchConfig = Annotated[Pedal | CanButton, Field(discriminator="source")]
SwitchConfig = AlwaysHeld | Pedal | CanButton | ConsoleHold
