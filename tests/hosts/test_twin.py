"""Two paths to a real robot process: while one is cut the robot follows on; with one path it holds.

A path whose address the robot's host does not have holds up neither an engage nor a stop.
"""

from __future__ import annotations

from contextlib import AsyncExitStack
from typing import TYPE_CHECKING

import pytest

from common.clock import monotonic_ns, to_ns, to_s
from common.wire.messages import Action
from deploy.harness.endpoints import free_port
from deploy.harness.host import HostWatch
from deploy.harness.rig import Rig, open_rig
from deploy.harness.start import start_tracking
from tests.tcp_path import TcpPath

if TYPE_CHECKING:
    from tests.conftest import OnThisHost

pytestmark = pytest.mark.live
NOWHERE = "tcp/192.0.2.1:7447"
"""An address for documentation (RFC 5737): no host has it."""
CUT_S = 1.5
"""Longer than any guard waits, and than Zenoh takes to give up a path."""


async def states_while_cut(twin: bool) -> tuple[set[str], int]:
    """The guard's states while the first path is cut, and the duplicates that the robot counted."""
    slave: list[str] = []
    master: list[str] = []
    async with AsyncExitStack() as stack:
        rig = await stack.enter_async_context(open_rig("tcp", overrides={"slave": slave, "master": master}))
        # the observer hears the robot where it listens, beside the path that is cut
        own, other = int(rig.endpoints.robots[0].rpartition(":")[2]), free_port("tcp")
        first, second = [await stack.enter_async_context(TcpPath(port).open()) for port in (own, other)]
        master.append(f'link.connect=["tcp/127.0.0.1:{first.port}"]')
        if twin:
            slave.append(f'link.twin.listen=["tcp/127.0.0.1:{other}"]')
            master.append(f'link.twin.connect=["tcp/127.0.0.1:{second.port}"]')
        await start_tracking(rig)
        rig.observer.recording = True
        begun_ns = monotonic_ns()
        first.cut = True
        await _until_ns(rig, begun_ns + to_ns(CUT_S))
        first.cut = False
        seen = {state.guard for state in rig.observer.states if state.sent_ns > begun_ns}
        assert rig.observer.slave is not None
        counted = rig.observer.slave.link["command"].duplicates
        assert set((await rig.stop()).values()) == {0}
        return seen, counted


async def _until_ns(rig: Rig, until_ns: int) -> None:
    await rig.until(lambda: rig.observer.sent_ns > until_ns, CUT_S + 20.0, "states while cut", rig.check)


@pytest.mark.timeout(400)
def test_a_cut_path_makes_no_hold_where_there_are_two(on_this_host: OnThisHost) -> None:
    async def story(_: HostWatch) -> None:
        seen, duplicates = await states_while_cut(twin=True)
        assert seen == {"track"}
        assert duplicates > 0

    on_this_host(story)


@pytest.mark.timeout(400)
def test_a_cut_path_makes_the_robot_hold_where_it_is_the_only_one(on_this_host: OnThisHost) -> None:
    async def story(_: HostWatch) -> None:
        seen, duplicates = await states_while_cut(twin=False)
        assert "hold" in seen
        assert duplicates == 0

    on_this_host(story)


@pytest.mark.timeout(400)
@pytest.mark.parametrize("first", [False, True], ids=["second path missing", "first path missing"])
def test_a_robot_whose_modem_never_comes_up_engages_and_stops_at_once(
    on_this_host: OnThisHost, first: bool
) -> None:
    async def story(_: HostWatch) -> None:
        slave: list[str] = []
        async with open_rig("tcp", overrides={"slave": slave}) as rig:
            own = ", ".join(f'"{end}"' for end in rig.endpoints.listening(0))
            ends = [f'"{NOWHERE}"', own] if first else [own, f'"{NOWHERE}"']
            slave += [f"link.listen=[{ends[0]}]", f"link.twin.listen=[{ends[1]}]"]
            await start_tracking(rig)
            begun_ns = monotonic_ns()
            reply = await rig.control(Action.ESTOP)
            took_s = to_s(monotonic_ns() - begun_ns)
            assert reply.done
            assert took_s < 1.0
            await rig.until(lambda: rig.observer.slave is not None, 5.0, "statistics", rig.check)
            assert rig.observer.slave is not None
            assert NOWHERE in rig.observer.slave.paths
            assert set((await rig.stop()).values()) == {0}

    on_this_host(story)
