"""`[servos.payload]`: what the robot carries, so that its weight is not taken for somebody's push."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated

from pydantic import Field

from common.config.section import Section
from common.errors import ConfigMistake
from common.skeleton import Skeleton

Coordinate = Annotated[float, Field(ge=-1.0, le=1.0)]


class PayloadConfig(Section):
    """`[servos.payload.<segment>]`: one thing that a segment, such as a hand, holds."""

    mass_kg: float = Field(gt=0.0, le=10.0)
    center_m: Annotated[list[Coordinate], Field(min_length=3, max_length=3)]
    """Its centre of mass in the segment's own frame: from its joint, x ahead, y left, z up at posture 0."""


def payload_mistakes(payload: Mapping[str, PayloadConfig], skeleton: Skeleton) -> list[ConfigMistake]:
    """Payloads of segments that the robot has not."""
    names = ", ".join(skeleton.segment_names)
    return [
        ConfigMistake(f"servos.payload.{name}", name, f"a segment of the {skeleton.name} profile: {names}")
        for name in payload
        if name not in skeleton.segment_names
    ]
