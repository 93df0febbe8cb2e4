"""A joint that is given less than was asked: by which rule, and how much less."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum


class Rule(StrEnum):
    """Which limit a clamp kept."""

    POSITION = "position"
    """rad: where the joint was asked to be or would have come to rest, and the limit."""
    VELOCITY = "velocity"
    """rad/s"""
    ACCELERATION = "acceleration"
    """rad/s²"""


@dataclass(frozen=True, slots=True)
class Clamp:
    """A joint began to be given less than was asked; asked and given are in the rule's unit."""

    at_ns: int
    joint: str
    rule: Rule
    asked: float
    given: float
