"""Suit, master and robot on two hosts over `4g`: the robot follows, holds in an outage, and comes back."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from common.clock import monotonic_ns, to_ns, to_s
from deploy.harness.engage import until_tracking
from deploy.harness.host import HostWatch
from deploy.harness.rig import Rig, open_rig
from deploy.harness.start import start_tracking
from deploy.sim.network import Network, load_profile, open_network
from slave.guard.config import GuardConfig

if TYPE_CHECKING:
    from tests.conftest import OnThisHost


OUTAGE_S = 5.0
BACK_S = 1.5
"""After the link is back commands flow again within this."""
HOLD_S = 1.0


@pytest.mark.timeout(400)
def test_the_robot_holds_in_an_outage_and_moves_only_when_engaged(on_this_host: OnThisHost) -> None:
    async def story(_: HostWatch) -> None:
        async with open_network(load_profile("4g")) as network, open_rig("tcp", network=network) as rig:
            await tracks(rig)
            assert rig.observer.slave is not None
            one_way_ms = rig.observer.slave.one_way_ms.p50
            assert one_way_ms is not None
            assert 15.0 < one_way_ms < 60.0
            await outage(rig, network)
            await until_tracking(rig)
            none_was_stale(rig)
            statuses = await rig.stop()
            assert set(statuses.values()) == {0}

    on_this_host(story)


async def tracks(rig: Rig) -> None:
    await start_tracking(rig)
    observer = rig.observer
    await rig.until(
        lambda: observer.slave is not None and observer.slave.one_way_ms.count > 12,
        10.0,
        "statistics",
    )


async def outage(rig: Rig, network: Network) -> None:
    observer = rig.observer
    observer.recording = True
    cut_ns = monotonic_ns()
    await network.outage(OUTAGE_S)
    back_ns = monotonic_ns()
    during = [s for s in observer.states if s.sent_ns > cut_ns + to_ns(HOLD_S)]
    assert {state.guard for state in during} == {"hold"}

    def again() -> bool:
        state = observer.state
        return state is not None and state.echo is not None and state.echo.received_ns > back_ns

    await rig.until(again, 10.0, "commands after the outage", rig.check)
    states = [s for s in observer.states if s.echo is not None and s.echo.received_ns > back_ns]
    first = states[0].echo
    assert first is not None
    assert to_s(first.received_ns - back_ns) < BACK_S
    assert first.put_ns > back_ns  # nothing of what waited in the outage was taken
    since_ns = observer.sent_ns
    await rig.until(lambda: observer.sent_ns > since_ns + to_ns(2.0), 10.0, "two seconds of states")
    after = [s for s in observer.states if s.sent_ns > back_ns]
    assert {state.guard for state in after} == {"hold"}


def none_was_stale(rig: Rig) -> None:
    """One machine, one clock: the true age of every command that the guard accepted."""
    echoes = {s.echo.sequence: s.echo for s in rig.observer.states if s.echo is not None}
    ages_s = [to_s(echo.received_ns - echo.put_ns) for echo in echoes.values()]
    assert len(ages_s) > 10
    assert max(ages_s) < GuardConfig().max_age_s
    assert rig.observer.slave is not None
    guard = rig.observer.slave.guard
    assert guard.losses["command"] >= 1
    assert guard.received == guard.accepted + sum(guard.dropped.values())
