"""Both directions of an emulated link, and what may be asked of it. Pure; `forwarder.py` feeds it packets."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

from deploy.sim.network.profile import Profile
from deploy.sim.network.scheduler import Counters, PacketScheduler

TO_ROBOT, TO_OPERATOR = "to_robot", "to_operator"


@dataclass(frozen=True, slots=True)
class LinkCounters:
    """What the link has done since it was opened, each way."""

    to_robot: Counters
    to_operator: Counters


@dataclass(frozen=True, slots=True)
class LinkRequest:
    """A change of the link; the answer is its `LinkCounters`."""

    profile: str = ""
    """The new profile as JSON; empty: it stays."""
    cut: bool | None = None
    """Whether nothing passes; None: as before."""


class Emulation(Protocol):
    """What emulates the link: the forwarder process, or the kernel (netem)."""

    name: str

    def set(self, profile: Profile) -> None:
        """Change the link to this profile. Raises NetworkError."""

    def cut(self, cut: bool) -> None:
        """Let nothing pass, or let it pass again. Raises NetworkError."""

    def counters(self) -> LinkCounters:
        """Raises NetworkError."""

    def close(self) -> None:
        """End it; nothing passes any more."""


class EmulatedLink:
    """Two schedulers, and the requests by which another process changes them."""

    def __init__(self, profile: Profile, seed: int = 0, now_ns: int = 0) -> None:
        ways = profile.ways
        self._ways: dict[str, PacketScheduler[bytes]] = {
            # each with its own draws: what one direction carries does not change the other's luck
            TO_ROBOT: PacketScheduler(ways.to_robot, 2 * seed, now_ns),
            TO_OPERATOR: PacketScheduler(ways.to_operator, 2 * seed + 1, now_ns),
        }

    def push(self, way: str, now_ns: int, packet: bytes) -> None:
        """Take an IP packet."""
        self._ways[way].push(now_ns, packet, len(packet))

    def due(self, now_ns: int) -> Iterator[tuple[str, bytes]]:
        """The packets that arrive by now, each with its direction."""
        for way, scheduler in self._ways.items():
            for packet in scheduler.due(now_ns):
                yield way, packet

    @property
    def next_ns(self) -> int | None:
        """When the next packet arrives; None while none is under way."""
        times = [ns for scheduler in self._ways.values() if (ns := scheduler.next_ns) is not None]
        return min(times, default=None)

    def answer(self, request: LinkRequest, now_ns: int) -> LinkCounters:
        """Change the link as requested."""
        to_robot, to_operator = self._ways[TO_ROBOT], self._ways[TO_OPERATOR]
        if request.profile:
            ways = Profile.model_validate_json(request.profile).ways
            to_robot.set(ways.to_robot, now_ns)
            to_operator.set(ways.to_operator, now_ns)
        if request.cut is not None:
            to_robot.cut = to_operator.cut = request.cut
        return LinkCounters(to_robot.counters, to_operator.counters)
