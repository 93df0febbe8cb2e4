"""What tests share: no example has a deadline, and a trial that the host itself spoilt is tried again."""

from __future__ import annotations

import asyncio
import os
from collections.abc import Awaitable, Callable

import pytest
from hypothesis import HealthCheck, settings

from common.clock import monotonic_ns
from common.errors import TandemError
from deploy.rig.host import Host, watch_host

# how long an example takes is the machine's affair; and a change is judged by the same examples each time
settings.register_profile(
    "tandem", deadline=None, derandomize="CI" in os.environ, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("tandem")

TRIES = 4

Story = Callable[[Host], Awaitable[None]]
OnThisHost = Callable[[Story], None]
"""The fixture's type."""


@pytest.fixture
def on_this_host() -> OnThisHost:
    """Runs a story of real processes beside a loop that does nothing but tick.

    Where it fails and the host itself stood still meanwhile, nothing was shown, and it is tried again, up to
    TRIES times in all; where it fails on a host that kept its time, it has failed. A host that spoilt every
    try is told as the reason to skip.
    """

    def run(story: Story) -> None:
        for _ in range(TRIES):
            spoilt = asyncio.run(_spoilt(story))
            if not spoilt:
                return
            print(f"the host stood still, tried again: {spoilt}")  # noqa: T201
        pytest.skip(f"the host itself stood still in each of {TRIES} tries; last: {spoilt}")

    return run


async def _spoilt(story: Story) -> str:
    """Why the trial failed where the host is to blame, empty where it went well; else raises what it did."""
    async with watch_host() as host:
        began_ns = monotonic_ns()
        try:
            await story(host)
        except (AssertionError, TandemError) as error:
            if not await host.spoilt(began_ns):
                raise
            return str(error) or repr(error)
        return ""
