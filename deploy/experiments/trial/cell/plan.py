"""Which cells a trial has, in which order they run, and when a folder may be continued. Pure."""

from __future__ import annotations

import random
import re
from collections.abc import Iterable
from dataclasses import asdict, dataclass, fields, replace
from typing import Self

from common.errors import CodecError, TandemError
from common.metrics.tree import from_tree
from deploy.study.balanced import balanced_order

AXES = ("transports", "profiles", "strategies", "repeat")
"""What may differ between the runs that fill one report: which cells there are, not how one is run."""


@dataclass(frozen=True, slots=True)
class Setup:
    """What is compared: a transport over a network's profile, with a tracking strategy."""

    transport: str
    profile: str
    strategy: str

    @property
    def name(self) -> str:
        """Such as `udp with predict`."""
        return f"{self.transport} with {self.strategy}"


@dataclass(frozen=True, slots=True)
class CellKey:
    """One run of a setup."""

    setup: Setup
    repetition: int
    """Counted from 1."""

    @property
    def slug(self) -> str:
        """Its file's name."""
        s = self.setup
        words = (s.profile, s.transport, s.strategy, str(self.repetition))
        return "-".join(re.sub(r"[^A-Za-z0-9_]+", "_", word) for word in words)


@dataclass(frozen=True, slots=True)
class TrialPlan:
    """A whole trial, as the command line chose it."""

    transports: tuple[str, ...]
    profiles: tuple[str, ...]
    """Network profiles, by name or file."""
    strategies: tuple[str, ...]
    repeat: int
    seconds: float
    """Seconds that are judged in each run."""
    outage_s: float
    """The outage after it; 0: none."""
    robot: str
    """Its profile: nursing, hand, lower_limb."""
    motion: str
    seed: int
    router: bool
    """Whether the two sides meet at a router."""
    max_age_s: float
    """The guard's age limit; 0: as the network's profile needs it (`settings.py`)."""
    hosts: str = "namespaces"
    """`namespaces`, or the endpoint of the robot's host in a remote trial."""
    blinded: str = ""
    """The commitment to the key of a blinded trial, whose `transports` are codes; empty where it is not."""

    def setups(self) -> list[Setup]:
        """By profile, then transport, then strategy: the report's order."""
        return [
            Setup(transport, profile, strategy)
            for profile in self.profiles
            for transport in self.transports
            for strategy in self.strategies
        ]

    def cells(self) -> list[CellKey]:
        """In the order they run: every setup once before any twice, each time in another order.

        So a machine that slows down as the trial goes on does not favour those that come first. The order of
        a blinded trial is balanced: over the repeats, each setup comes at each place equally often.
        """
        cells = []
        for repetition in range(1, 1 + self.repeat):
            turn = [CellKey(setup, repetition) for setup in self.setups()]
            if self.blinded:
                turn = balanced_order(turn, repetition - 1, self.seed)
            else:
                random.Random(f"{self.seed} {repetition}").shuffle(turn)
            cells += turn
        return cells

    def seed_of(self, cell: CellKey) -> int:
        """The random seed of sensors and network, equal for all setups of a repetition."""
        return 1000 * self.seed + cell.repetition

    def tree(self) -> dict[str, object]:
        """As JSON."""
        return {key: list(v) if isinstance(v, tuple) else v for key, v in asdict(self).items()}

    @classmethod
    def of_tree(cls, tree: object) -> Self:
        """Back from JSON. Raises TandemError where it is none."""
        names = {field.name for field in fields(cls)}
        if not isinstance(tree, dict) or not names - {"blinded"} <= set(tree) <= names:
            raise TandemError("the report folder's plan is of another version of tandem")
        try:
            return from_tree(cls, tree)
        except CodecError as error:
            raise TandemError(f"the report folder's plan cannot be read ({error})") from None


def check_continues(old: TrialPlan, new: TrialPlan) -> None:
    """Whether cells of `old` may stand in a report of `new`. Raises TandemError with what differs."""
    before, after = old.tree(), new.tree()
    differs = [
        f"{key.replace('_', ' ')} was {before[key]}, is {after[key]}"
        for key in before
        if key not in AXES and before[key] != after[key]
    ]
    if differs:
        raise TandemError(
            "the report folder holds cells of another plan: "
            + "; ".join(differs)
            + ". Give another --report folder, or the same options (transports, profiles, strategies and "
            "--repeat may differ: only new cells are run)"
        )


def merged(old: TrialPlan, new: TrialPlan) -> TrialPlan:
    """The plan of a report that shows the cells of both. They must continue each other."""
    check_continues(old, new)
    return replace(
        new,
        transports=_union(old.transports, new.transports),
        profiles=_union(old.profiles, new.profiles),
        strategies=_union(old.strategies, new.strategies),
        repeat=max(old.repeat, new.repeat),
    )


def _union(old: Iterable[str], new: Iterable[str]) -> tuple[str, ...]:
    return tuple(dict.fromkeys((*old, *new)))
