"""Where troubles enter the virtual world: on the link, in the clocks, between the slave and its robot."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import StrEnum

from common.quaternion import Array
from slave.guard.body import WELL, Body
from slave.limit.limit import Setpoint
from slave.servos.servos import EncoderReading


class Traffic(StrEnum):
    """What goes over the link."""

    COMMAND = "command"
    STATE = "state"
    QUERY = "clock query"
    REPLY = "clock reply"


Delivery = tuple[int, bytes]
"""How much later than usual a message arrives, ns, and its bytes."""


@dataclass(slots=True)
class FaultInjection:
    """None unless told; each may be replaced at any moment of a run."""

    carry: Callable[[Traffic, bytes], Sequence[Delivery]] = lambda _, payload: ((0, payload),)
    """What the link makes of a message: nothing, one, or more."""
    master_stepped_ns: int = 0
    """By how much the master's clock has been stepped; nothing else in the world notices."""
    slave_stepped_ns: int = 0
    suit_heard: bool = True
    """Whether the bus between suit and master works."""
    read: Callable[[EncoderReading], EncoderReading] = lambda reading: reading
    """What becomes of a reading between the encoders and the slave."""
    write: Callable[[Array], Array] = lambda position_rad: position_rad
    """What becomes of setpoints (J,) between the slave and the drives."""
    body: Callable[[], Body] = lambda: WELL
    """What drives and base say of themselves."""
    watch: Callable[[EncoderReading, Setpoint], None] = lambda reading, setpoint: None
    """Sees what the encoders truly show, and what the slave asked for, in each of its ticks."""
