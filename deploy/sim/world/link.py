"""The link of the virtual world: messages are late or lost as over an emulated network, without packets."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from deploy.sim.network.profile import Profile
from deploy.sim.network.scheduler import PacketScheduler
from deploy.sim.world.injection import Traffic

TO_ROBOT = (Traffic.COMMAND, Traffic.QUERY)
At = Callable[[int, Callable[[], None]], None]
"""Schedules an event at a time, ns."""


class VirtualLink:
    """Delivers each message when the profile says so, or not at all; each is one packet of its own size."""

    def __init__(self, profile: Profile, seed: int, at: At) -> None:
        """`at` is schedules what happens later."""
        ways = profile.ways
        self._to_robot: PacketScheduler[Callable[[], None]] = PacketScheduler(ways.to_robot, 2 * seed)
        self._to_operator: PacketScheduler[Callable[[], None]] = PacketScheduler(
            ways.to_operator, 2 * seed + 1
        )
        self._at = at

    def set(self, profile: Profile, now_ns: int) -> None:
        """From now on behave so; what is under way arrives as it would have."""
        ways = profile.ways
        self._to_robot.set(ways.to_robot, now_ns)
        self._to_operator.set(ways.to_operator, now_ns)

    def send(self, traffic: Traffic, now_ns: int, size: int, arrive: Callable[[], None]) -> None:
        """Take a message of `size` bytes; `arrive` is called when it does."""
        direction = self._to_robot if traffic in TO_ROBOT else self._to_operator
        direction.push(now_ns, arrive, size)
        self._await(direction)

    def _await(self, direction: PacketScheduler[Callable[[], None]]) -> None:
        due_ns = direction.next_ns
        if due_ns is not None:
            self._at(due_ns, partial(self._deliver, direction, due_ns))

    def _deliver(self, direction: PacketScheduler[Callable[[], None]], now_ns: int) -> None:
        arrived = direction.due(now_ns)
        for arrive in arrived:
            arrive()
        if arrived:
            self._await(direction)
