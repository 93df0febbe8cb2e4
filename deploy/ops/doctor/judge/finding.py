"""What one check found: how well it is, a description, and what to do."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum


class Health(StrEnum):
    """How a check ended."""

    OK = "ok"
    WARN = "warn"
    """It will run, but worse than it could, or not for ever."""
    FAIL = "fail"
    """It will not run, or a robot would refuse it."""


@dataclass(frozen=True, slots=True)
class Finding:
    """One row of the report."""

    check: str
    health: Health
    found: str
    advice: str = ""
    """What to do; empty where there is nothing to do."""


def ok(check: str, found: str, advice: str = "") -> Finding:
    """The check passed; the advice is optional."""
    return Finding(check, Health.OK, found, advice)


def warn(check: str, found: str, advice: str) -> Finding:
    """Not as it should be."""
    return Finding(check, Health.WARN, found, advice)


def fail(check: str, found: str, advice: str) -> Finding:
    """It must be mended first."""
    return Finding(check, Health.FAIL, found, advice)


def worst(findings: Sequence[Finding]) -> Health:
    """The worst health of all findings; ok if there is none."""
    order = list(Health)
    return max((finding.health for finding in findings), key=order.index, default=Health.OK)
