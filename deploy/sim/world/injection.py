"""Where faults enter the virtual world: the link, the clocks, the suit's bus, between slave and robot."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import StrEnum

from common.quaternion import Array
from slave.guard.body import WELL, Body
from slave.limit.limit import Setpoint
from slave.servos.servos import EncoderReading


class Traffic(StrEnum):
    """The kinds of message on the link."""

    COMMAND = "command"
    STATE = "state"
    QUERY = "clock query"
    REPLY = "clock reply"


Delivery = tuple[int, bytes]
"""The delay of a message beyond the link's own, ns, and its bytes."""


@dataclass(slots=True)
class FaultInjection:
    """No fault by default; each member may be replaced at any moment of a run."""

    carry: Callable[[Traffic, bytes], Sequence[Delivery]] = lambda _, payload: ((0, payload),)
    """The messages that arrive for one that was sent: none, one, or more."""
    master_stepped_ns: int = 0
    """The step of the master's clock, ns; no other clock is stepped."""
    slave_stepped_ns: int = 0
    suit_heard: bool = True
    """Whether the bus between suit and master works."""
    read: Callable[[EncoderReading], EncoderReading] = lambda reading: reading
    """Changes a reading between the encoders and the slave."""
    write: Callable[[Array], Array] = lambda position_rad: position_rad
    """Changes setpoints (J,) between the slave and the drives."""
    body: Callable[[], Body] = lambda: WELL
    """What drives and base report of themselves."""
    watch: Callable[[EncoderReading, Setpoint], None] = lambda reading, setpoint: None
    """Called in each tick of the slave with the true encoder reading and the slave's setpoint."""
