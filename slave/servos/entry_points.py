"""The backends that are installed, by name: entry points of the group `tandem.servos`.

A backend is loaded only where a file names it, so that a broken package does not disturb other robots.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping
from functools import lru_cache
from importlib import import_module
from importlib.metadata import entry_points

from common.errors import TandemError
from slave.servos.backend import Backend, BackendConfig

GROUP = "tandem.servos"


class InstalledBackends(Mapping[str, Backend[BackendConfig]]):
    """All backends by name. Taking one loads its package."""

    def __init__(self, own: Mapping[str, object]) -> None:
        """`own`: tandem's own, known also where tandem is a checkout that is not installed."""
        self._own = own

    def __iter__(self) -> Iterator[str]:
        """The names: tandem's own first."""
        return iter([*self._own, *sorted(self._others())])

    def __len__(self) -> int:
        """How many are installed."""
        return len(self._own) + len(self._others())

    def __getitem__(self, name: str) -> Backend[BackendConfig]:
        """The backend of a name. Raises KeyError for an unknown one, TandemError if it cannot be loaded."""
        where = own_place(name) if name in self._own else self._others()[name]
        module, _, attribute = where.partition(":")
        try:
            found: object = self._own.get(name) or getattr(import_module(module), attribute)
        except (ImportError, AttributeError) as error:
            raise TandemError(
                f"servo backend {name!r} cannot be loaded from {where} ({error}): "
                "repair or remove its package"
            ) from error
        if not isinstance(found, Backend):
            raise TandemError(f"servo backend {name!r}: expected a Backend at {where}, not {found!r}")
        return found

    def _others(self) -> dict[str, str]:
        return _installed(tuple(sys.path), frozenset(self._own))


def own_place(name: str) -> str:
    """Where tandem's own backend of a name is, as in pyproject.toml."""
    return f"slave.servos.{name}.backend:BACKEND"


@lru_cache(maxsize=8)
def _installed(_: tuple[str, ...], own: frozenset[str]) -> dict[str, str]:
    """Backends of other packages; searched for once for each search path, as that takes 10 ms."""
    found: dict[str, str] = {}
    for point in entry_points(group=GROUP):
        mine = own_place(point.name) if point.name in own else ""
        if point.value == mine:
            continue
        if other := mine or found.get(point.name):
            raise TandemError(
                f"two packages offer the servo backend {point.name!r}, {other} and {point.value}: "
                "remove one, or give its entry point another name"
            )
        found[point.name] = point.value
    return found
