"""The result of one cell, to JSON and back. Pure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum

from common.errors import CodecError, TandemError
from common.metrics.tree import from_tree
from deploy.experiments.trial.cell.figures import FIGURES, Values, rounded
from deploy.experiments.trial.cell.plan import CellKey

VERSION = 1


class CellStatus(StrEnum):
    """How a cell ended."""

    DONE = "done"
    IMPOSSIBLE = "impossible"
    """It cannot be run at all: a transport that does not cross hosts."""
    FAILED = "failed"
    """It ran without a result; the next run tries it again."""


@dataclass(frozen=True, slots=True)
class Excerpt:
    """A few seconds of one joint, for a plot."""

    joint: str
    at_s: Sequence[float]
    """(T,)"""
    operator_deg: Sequence[float]
    """(T,) true."""
    robot_deg: Sequence[float]
    """(T,) by its encoder."""


@dataclass(frozen=True, slots=True)
class Cell:
    """One run of a setup and its result."""

    key: CellKey
    status: CellStatus
    why: str = ""
    """Why there is no result."""
    values: Values = field(default_factory=dict)
    remarks: tuple[str, ...] = ()
    """What happened meanwhile, such as a hold and its reason."""
    settings: Mapping[str, str] = field(default_factory=dict)
    """What was set for this profile over the example files."""
    counts: Mapping[str, Mapping[str, int]] = field(default_factory=dict)
    """The guard's events in the judged time: dropped by gate, losses, clamps by rule."""
    one_way_ms: tuple[float, ...] = ()
    """Percentiles 0, 1 … 100 of the true one-way of accepted commands."""
    excerpt: Excerpt | None = None

    @property
    def settled(self) -> bool:
        """Whether the cell need not run again."""
        return self.status is not CellStatus.FAILED

    def tree(self) -> dict[str, object]:
        """As JSON, rounded."""
        setup, excerpt = self.key.setup, self.excerpt
        return {
            "version": VERSION,
            "transport": setup.transport,
            "profile": setup.profile,
            "strategy": setup.strategy,
            "repetition": self.key.repetition,
            "status": str(self.status),
            "why": self.why,
            "figures": rounded(self.values),
            "remarks": list(self.remarks),
            "settings": dict(self.settings),
            "counts": {name: dict(count) for name, count in self.counts.items()},
            "one_way_ms": [round(v, 2) for v in self.one_way_ms],
            "excerpt": None
            if excerpt is None
            else {
                "joint": excerpt.joint,
                "at_s": [round(v, 3) for v in excerpt.at_s],
                "operator_deg": [round(v, 2) for v in excerpt.operator_deg],
                "robot_deg": [round(v, 2) for v in excerpt.robot_deg],
            },
        }

    @classmethod
    def of_tree(cls, tree: object) -> Cell:
        """Back from JSON. Raises TandemError where it is none of this version's."""
        if not isinstance(tree, Mapping) or "version" not in tree:
            raise TandemError("not a cell of a trial (it has no version)")
        if tree["version"] != VERSION:
            raise TandemError(f"a cell of version {tree['version']}, this tandem reads {VERSION}")
        try:
            setup = {name: tree[name] for name in ("transport", "profile", "strategy")}
            same = ("status", "why", "remarks", "settings", "counts", "one_way_ms", "excerpt")
            found = {name: tree[name] for name in same}
            found["key"] = {"setup": setup, "repetition": tree["repetition"]}
            found["values"] = {f.name: tree["figures"].get(f.name) for f in FIGURES}
            return from_tree(cls, found)
        except (KeyError, AttributeError) as error:
            raise TandemError(f"not a cell of a trial ({error!r})") from None
        except CodecError as error:
            raise TandemError(f"not a cell of a trial ({error})") from None
