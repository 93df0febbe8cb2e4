"""What a second path is worth: one motion over one path and over two; the first is whole, loses, is cut.

On a virtual clock, with the receivers' own rule for copies. Where the robot holds, the operator engages it
again a second after the fault is over, as a person would.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum

from common.clock import to_s
from common.wire.messages import Action
from deploy.measure import motion
from deploy.sim.network.profile import Profile, Way
from deploy.sim.world.twin_link import DEAD, TwinLink
from deploy.sim.world.world import VirtualWorld, WorldSettings

CUT_S = 1.5
LOST_PERCENT = 20.0
BEFORE_S = 2.0
AGAIN_S = 1.0
SETTLE_S = 0.5


class PathFault(StrEnum):
    """What happens to the first path."""

    WHOLE = "both whole"
    LOSS = f"first loses {LOST_PERCENT:g} %"
    CUT = f"first cut for {CUT_S:g} s"


@dataclass(frozen=True, slots=True)
class PathRow:
    """One run."""

    fault: PathFault
    paths: int
    holds: int
    followed: float
    """Share of the time in which the robot followed, whether or not anybody heard of it."""
    missing: float
    """Share of the commands that were not there when they were due."""
    rmse_deg: float | None
    """Against the operator at the same instant, while it followed; None where it hardly did."""
    kb_s: float
    """Sent, both ways together."""


def rows(first: Profile, second: Profile, seconds: float, seed: int) -> Iterator[PathRow]:
    """Each fault over one path, then over two."""
    for fault in PathFault:
        for paths in (1, 2):
            yield run(fault, first, second if paths == 2 else None, seconds, seed)


def run(fault: PathFault, first: Profile, second: Profile | None, seconds: float, seed: int) -> PathRow:
    """One run; `second` None: over the first path alone. Raises TandemError if the robot never follows."""
    world = VirtualWorld(WorldSettings(network_seed=seed))
    link = TwinLink(first, second, seed, world._at)
    world.link = link
    world.engage()
    world.run(SETTLE_S)
    guard, due = world.slave.guard, world.slave.traffic.due
    held_before, due_before, begun_ns = sum(guard.counters.losses.values()), due.metrics(), world.now_ns
    sent_before = link.sent_bytes
    watch = _Watch(world)
    _play(watch, link, fault, first, seconds)
    found = due.metrics()
    expected = found.expected - due_before.expected
    followed = motion(world.trace.truth(), world.moved(), world.trace.joint_names)
    return PathRow(
        fault,
        1 if second is None else 2,
        holds=sum(guard.counters.losses.values()) - held_before,
        followed=watch.tracked / max(1, watch.looks),
        missing=(found.missing - due_before.missing) / max(1, expected),
        rmse_deg=None if followed is None else followed.rmse_deg,
        kb_s=1e-3 * (link.sent_bytes - sent_before) / to_s(world.now_ns - begun_ns),
    )


class _Watch:
    """Counts at the robot itself: of the states, those of a cut are missing."""

    def __init__(self, world: VirtualWorld) -> None:
        self.world = world
        self.looks = self.tracked = 0

    def run(self, seconds: float) -> None:
        """Go on, and count."""
        self.world.run(seconds, until=self._look)

    def _look(self) -> bool:
        self.looks += 1
        self.tracked += self.world.slave.guard.state == "track"
        return False


def _play(watch: _Watch, link: TwinLink, fault: PathFault, first: Profile, seconds: float) -> None:
    world = watch.world
    watch.run(BEFORE_S)
    left_s = seconds - BEFORE_S
    match fault:
        case PathFault.LOSS:
            link.set(lossy(first), world.now_ns)
        case PathFault.CUT:
            link.set(DEAD, world.now_ns)
            watch.run(CUT_S)
            link.set(first, world.now_ns)
            left_s -= CUT_S
    while left_s > 0.0:
        step_s = min(AGAIN_S, left_s)
        watch.run(step_s)
        left_s -= step_s
        if world.slave.guard.state == "hold":
            world.ask(Action.ENGAGE)


def lossy(profile: Profile) -> Profile:
    """The same, losing packets one by one."""
    loss = {"loss_percent": LOST_PERCENT, "burst_packets": None}
    ways = profile.ways
    to_robot, to_operator = (Way(**{**way.model_dump(), **loss}) for way in (ways.to_robot, ways.to_operator))
    return profile.model_copy(update={"to_robot": to_robot, "to_operator": to_operator})
