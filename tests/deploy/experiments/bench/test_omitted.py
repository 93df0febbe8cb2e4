"""What a bench does not measure because it was stuck is in its figures all the same."""

from __future__ import annotations

import asyncio

import pytest

from deploy.experiments.bench import round_trips
from deploy.experiments.bench.loop import with_missed
from deploy.experiments.bench.round_trips import TIMEOUT_S, Stagger

PERIOD_NS = 5_000_000


def test_missed_ticks_are_late_until_the_next_one_ran() -> None:
    assert with_missed(100_000, 0, PERIOD_NS) == [100_000]
    assert with_missed(100_000, 2, PERIOD_NS) == [100_000, 100_000 + PERIOD_NS, 100_000 + 2 * PERIOD_NS]


def test_an_echo_that_never_came_is_no_fast_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every fifth is lost; without them the link would look perfect."""

    async def measured() -> float:
        stagger, sent = Stagger(), 0

        def send(_: bytes) -> None:
            nonlocal sent
            sent += 1

        async def round_trip_ns(_: object) -> int | None:
            send(b"")
            return None if sent % 5 == 0 else 200_000

        monkeypatch.setattr(stagger, "_round_trip_ns", round_trip_ns)
        stagger.doors["one"] = send
        figures = await stagger.measure(1.0)
        return figures["one"]["max"]

    monkeypatch.setattr(round_trips, "WARM_UP", 0)
    assert asyncio.run(measured()) == pytest.approx(1e6 * TIMEOUT_S / 2)
