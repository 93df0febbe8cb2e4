"""Versions of this software, so that two hosts can check that they run the same."""

from __future__ import annotations

import platform
from functools import cache
from importlib.metadata import PackageNotFoundError, version

from common.metrics.parts import Software
from common.wire.codec import VERSION as SCHEMA


@cache
def software() -> Software:
    """Versions of tandem, of its messages' schema, of Zenoh and of Python; part of every side's figures."""
    return Software(
        tandem=installed("tandem"),
        schema=SCHEMA,
        zenoh=installed("eclipse-zenoh"),
        python=platform.python_version(),
    )


def installed(package: str) -> str:
    """A package's version, `unknown` where it is not installed."""
    try:
        return version(package)
    except PackageNotFoundError:  # run from a checkout that is not installed
        return "unknown"
