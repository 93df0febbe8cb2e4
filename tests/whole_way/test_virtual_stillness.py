"""Both sides stand still together: no number is skipped, and yet nobody may call the link well."""

from __future__ import annotations

import pytest

from deploy.sim.world.world import VirtualWorld, WorldSettings
from tests.whole_way.runs import engaged

STILL_S = 5.0


@pytest.fixture(scope="module")
def stood_still() -> VirtualWorld:
    run = engaged(WorldSettings())
    run.run(6.0)
    assert run.slave.traffic.due.metrics().missing == 0
    run.stand_still(STILL_S)
    run.run(4.0)
    return run


def test_no_number_tells_of_it_and_time_does(stood_still: VirtualWorld) -> None:
    slave = stood_still.slave
    assert slave.traffic.arrivals.metrics().lost == 0
    assert slave.traffic.due.metrics().missing == pytest.approx(12.5 * STILL_S, abs=4)


def test_the_raw_one_way_hides_it_and_the_corrected_one_shows_it(stood_still: VirtualWorld) -> None:
    slave = stood_still.slave
    raw, corrected = slave.traffic.one_way.summary(), slave.traffic.due.corrected.summary()
    assert raw.max is not None
    assert raw.max < 10.0
    assert corrected.max == pytest.approx(1e3 * STILL_S, abs=300.0)
    assert corrected.p99 is not None
    assert corrected.p99 > 4000.0
