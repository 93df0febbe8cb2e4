"""What a process counts of each of its CAN buses."""

from __future__ import annotations

from dataclasses import dataclass

from common.metrics.tree import Metrics


@dataclass(slots=True)
class BusCounters(Metrics):
    """One bus since the start; the counters only grow."""

    received: int = 0
    """Frames handed on."""
    sent: int = 0
    send_errors: int = 0
    undecodable: int = 0
    """Datagrams of a udp_multicast group that are no CAN frame."""
    own_heard: int = 0
    """Frames with an identifier this side sends: its echo on udp_multicast, elsewhere a second sender."""
    second_sender: int = 0
    """Those of them that are no echo: another program, or device, sends what only this side should."""
    foreign: int = 0
    """Frames with a 29-bit identifier, and remote frames: not of this protocol."""
    error_frames: int = 0
    times_down: int = 0
    failed_opens: int = 0


@dataclass(slots=True)
class BusMetrics(BusCounters):
    """One bus: its counters and its state."""

    up: bool = False
    state: str = ""
    """The controller's, by its last error frame; empty before the first."""
    last_error: str = ""
