"""How many tests may skip, by reason: `skips.toml` read and held against a run. Pure but for the reading."""

from __future__ import annotations

import re
import tomllib
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

TOO_MANY_SKIPPED = 10
"""Status of a run where too many tests skipped: none of pytest's own, so that .ci/tests can tell."""


@dataclass(frozen=True, slots=True)
class Allowed:
    """A reason for which so many tests may skip."""

    reason: str
    """Regular expression."""
    at_most: int
    why: str
    without: str = ""
    """Environment variable; where it is set, none may skip for this reason."""
    with_: str = ""
    """Environment variable; where it is not set, none may."""

    def limit(self, environment: Mapping[str, str]) -> int:
        """How many may skip here."""
        if self.without and environment.get(self.without):
            return 0
        if self.with_ and not environment.get(self.with_):
            return 0
        return self.at_most

    def condition(self) -> str:
        """On what the limit depends, in words; empty where on nothing."""
        return (f" while {self.without} is set" if self.without else "") + (
            f" unless {self.with_} is set" if self.with_ else ""
        )


def read_allowed(file: Path) -> list[Allowed]:
    """The reasons of a `skips.toml`. Raises KeyError, TypeError or re.error where it is not one."""
    rows: list[dict[str, Any]] = tomllib.loads(file.read_text("utf-8"))["skip"]
    allowed = [Allowed(with_=row.pop("with", ""), **row) for row in rows]
    for each in allowed:
        re.compile(each.reason)
    return allowed


def counted(reasons: Iterable[str]) -> list[str]:
    """A line a reason, the most frequent first."""
    return [f"{count} skipped: {reason}" for reason, count in Counter(reasons).most_common()]


def too_many(reasons: Sequence[str], allowed: Sequence[Allowed], environment: Mapping[str, str]) -> list[str]:
    """What is wrong with a run whose tests skipped for these reasons: a line for each."""
    counts: Counter[int] = Counter()
    wrong: list[str] = []
    for reason, count in Counter(reasons).items():
        row = next((i for i, each in enumerate(allowed) if re.search(each.reason, reason)), None)
        if row is None:
            wrong.append(f"{count} skipped for a reason that is not listed: {reason}")
        else:
            counts[row] += count
    for row, count in counts.items():
        if count > (limit := allowed[row].limit(environment)):
            condition = allowed[row].condition() if limit == 0 else ""
            wrong.append(f"{count} skipped, at most {limit} may{condition}: {allowed[row].reason}")
    return wrong
