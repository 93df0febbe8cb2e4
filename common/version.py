"""Which software this is, so that two hosts can tell whether they run the same."""

from __future__ import annotations

import platform
from functools import cache
from importlib.metadata import PackageNotFoundError, version

from common.codec import VERSION


@cache
def software() -> dict[str, object]:
    """Versions of tandem, of its messages' schema, of Zenoh and of Python; part of every side's figures."""
    return {
        "tandem": _installed("tandem"),
        "schema": VERSION,
        "zenoh": _installed("eclipse-zenoh"),
        "python": platform.python_version(),
    }


def _installed(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:  # run from a checkout that is not installed
        return "unknown"
