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
OWN = {
    # the simulated robot, inside the slave's process
    "mujoco": "slave.servos.mujoco.backend:BACKEND",
    # CiA 402 drives on CAN buses
    "canopen": "slave.servos.canopen.backend:BACKEND",
    # X series servos on a serial bus
    "dynamixel": "slave.servos.dynamixel.backend:BACKEND",
    # joints without a servo
    "absent": "slave.servos.absent.backend:BACKEND",
}
"""tandem's own, as in pyproject.toml; known here too, for a checkout that is not installed."""


class InstalledBackends(Mapping[str, Backend[BackendConfig]]):
    """All backends by name. Taking one loads its package."""

    def __iter__(self) -> Iterator[str]:
        """The names: tandem's own first."""
        return iter([*OWN, *sorted(self._others())])

    def __len__(self) -> int:
        """How many are installed."""
        return len(OWN) + len(self._others())

    def __getitem__(self, name: str) -> Backend[BackendConfig]:
        """The backend of a name. Raises KeyError for an unknown one, TandemError if it cannot be loaded."""
        where = OWN.get(name) or self._others()[name]
        module, _, attribute = where.partition(":")
        try:
            found = getattr(import_module(module), attribute)
        except (ImportError, AttributeError) as error:
            raise TandemError(
                f"servo backend {name!r} cannot be loaded from {where} ({error}): "
                "repair or remove its package"
            ) from error
        if not isinstance(found, Backend):
            raise TandemError(f"servo backend {name!r}: expected a Backend at {where}, not {found!r}")
        return found

    @staticmethod
    def _others() -> dict[str, str]:
        return _installed(tuple(sys.path))


@lru_cache(maxsize=8)
def _installed(_: tuple[str, ...]) -> dict[str, str]:
    """Backends of other packages; searched for once for each search path, as that takes 10 ms."""
    found: dict[str, str] = {}
    for point in entry_points(group=GROUP):
        if OWN.get(point.name) == point.value:
            continue
        other = OWN.get(point.name) or found.get(point.name)
        if other is not None:
            raise TandemError(
                f"two packages offer the servo backend {point.name!r}, {other} and {point.value}: "
                "remove one, or give its entry point another name"
            )
        found[point.name] = point.value
    return found


BACKENDS = InstalledBackends()
