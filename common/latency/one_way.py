"""How long a message took, from stamps of two hosts' clocks. Pure.

One way, by the measured offset θ = sender's clock − receiver's, which is known to ± its bound:

    one way = received + θ − sent

There and back, on the sender's clock alone:

    round trip = (answer arrived − sent) − (answer sent − received)
"""

from __future__ import annotations

from common.clock_sync import UNKNOWN_NS, Offset
from common.wire.messages import CommandEcho, RobotState, SaidOfRobot


def one_way_ns(sent_ns: int, received_ns: int, offset: Offset) -> int | None:
    """From `sent_ns` (remote clock) to `received_ns` (local clock); None if the offset is not trusted.

    `offset` is the sender's clock minus the receiver's. It may be wrong by its bound, so that a quick message
    seems to arrive before it left: the result is then below zero.
    """
    return offset.remote_ns(received_ns) - sent_ns if offset.trusted else None


def round_trip_ns(state: SaidOfRobot, echo: CommandEcho, arrived_ns: int) -> int:
    """From the put of the command in the echo to the state's arrival, without the time on the slave."""
    return arrived_ns - echo.put_ns - (state.sent_ns - echo.received_ns)


def master_offset(state: RobotState) -> Offset:
    """The master's clock minus the slave's, as the slave published it."""
    trusted = state.offset_bound_ns >= 0
    return Offset(state.master_offset_ns, state.offset_bound_ns if trusted else UNKNOWN_NS, trusted)
