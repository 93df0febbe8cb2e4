"""Two real chronyd on two hosts, over a line that is slow in one direction only.

Both hosts share the machine's clocks, so the true offset is 0, and a chronyd with `-x` only states. What is
physically true here: over a line of 60 ms there and 10 ms back the exchange's midpoint is wrong by 25 ms, and
no exchange over this line can know it, chrony's own neither. A chronyd knows it by a reference of its own,
such as GPS; here a third chronyd, to which each host has a short wire.
"""

from __future__ import annotations

import asyncio
import shutil
from collections.abc import AsyncIterator, Sequence
from contextlib import AsyncExitStack, asynccontextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from common.clock import NS_PER_MS, monotonic_ns, wall_ns
from common.clock_sync import ROUND_TRIP
from common.clock_sync.config import ClockConfig
from common.clock_sync.services import TimeServices
from common.metrics.slave import OffsetMetrics
from deploy.harness.host import HostWatch
from deploy.harness.rig import Rig, open_rig
from deploy.harness.start import start_all
from deploy.sim.network import EmulatedHost, Profile, Way, open_network
from deploy.sim.network.namespaces import MANAGEMENT

if TYPE_CHECKING:
    from tests.conftest import OnThisHost

CHRONYD = shutil.which("chronyd") or "/usr/sbin/chronyd"
PTP4L = shutil.which("ptp4l") or "/usr/sbin/ptp4l"
GPS_PORT = 11123
THERE_MS, BACK_MS = 60.0, 10.0
ONE_SIDED = Profile(name="one-sided", to_robot=Way(delay_ms=THERE_MS), to_operator=Way(delay_ms=BACK_MS))
HALF_TRIP_MS = (THERE_MS + BACK_MS) / 2
MIDPOINT_WRONG_MS = (THERE_MS - BACK_MS) / 2
SETTLE_S = 40.0

HAS_CHRONYD = pytest.mark.skipif(not Path(CHRONYD).exists(), reason="chronyd is missing: apt install chrony")


@asynccontextmanager
async def chronyd(
    folder: Path, name: str, lines: Sequence[str], host: EmulatedHost | None = None
) -> AsyncIterator[None]:
    """One daemon, which never touches the clock (`-x`)."""
    file = folder / f"{name}.conf"
    own = [f"pidfile {folder}/{name}.pid", f"bindcmdaddress {folder}/{name}.sock"]
    file.write_text("\n".join([*lines, *own, ""]), "utf-8")
    argv = [CHRONYD, "-x", "-d", "-u", "root", "-f", str(file)]
    log = (folder / f"{name}.log").open("ab")
    process = await asyncio.create_subprocess_exec(
        *(argv if host is None else host.command(argv)), stdout=log, stderr=log
    )
    try:
        yield
    finally:
        process.terminate()
        await process.wait()
        log.close()


def gps() -> list[str]:
    """A reference that is right."""
    return ["local stratum 1", "allow", f"port {GPS_PORT}", "cmdport 0"]


def follower(address: str, options: str = "", port: int = GPS_PORT) -> list[str]:
    """A host's own daemon."""
    server = f"server {address} port {port} iburst minpoll -2 maxpoll 0 maxdelay 3 {options}"
    return [server, "allow", "cmdport 323", "maxdistance 3"]


async def offset(rig: Rig, until: str) -> OffsetMetrics:
    """What the slave says of the clocks, once its words have this in them and it has gone all the way."""

    def there() -> bool:
        slave = rig.observer.slave
        words = "" if slave is None or not slave.offset.trusted else slave.offset.words
        return until in words and "going there" not in words

    await rig.until(there, SETTLE_S, f"clocks: {until}", rig.check)
    assert rig.observer.slave is not None
    return rig.observer.slave.offset


@HAS_CHRONYD
@pytest.mark.timeout(400)
def test_chrony_knows_a_one_sided_line_by_its_own_reference_only(
    on_this_host: OnThisHost, tmp_path: Path
) -> None:
    async def story(_: HostWatch) -> None:
        async with AsyncExitStack() as stack:
            network = await stack.enter_async_context(open_network(ONE_SIDED))
            operator, robot = network.operator, network.robot
            await stack.enter_async_context(chronyd(tmp_path, "gps", gps()))
            at_operator = follower(operator.caller)
            await stack.enter_async_context(chronyd(tmp_path, "operator", at_operator, operator))
            rig = await stack.enter_async_context(open_rig("tcp", network=network))
            await start_all(rig)
            alone = await offset(rig, "no time service here")
            judge_round_trip(alone)
            async with chronyd(tmp_path, "honest", follower(robot.caller), robot):
                judge_known(await offset(rig, "stated by chrony; "))
            lie = follower(robot.caller, "offset 0.5")
            async with chronyd(tmp_path, "liar", lie, robot):
                judge_lie(await offset(rig, "is not believed"))
            assert set((await rig.stop()).values()) == {0}

    on_this_host(story)


@HAS_CHRONYD
@pytest.mark.timeout(400)
def test_chrony_over_the_same_line_knows_no_more_than_the_round_trip(
    on_this_host: OnThisHost, tmp_path: Path
) -> None:
    async def story(_: HostWatch) -> None:
        async with AsyncExitStack() as stack:
            network = await stack.enter_async_context(open_network(ONE_SIDED))
            await stack.enter_async_context(chronyd(tmp_path, "gps", gps()))
            operator, robot = network.operator, network.robot
            at_operator = [*follower(operator.caller), f"port {GPS_PORT}"]
            await stack.enter_async_context(chronyd(tmp_path, "operator", at_operator, operator))
            at_robot = follower(operator.address)
            await stack.enter_async_context(chronyd(tmp_path, "robot", at_robot, robot))
            rig = await stack.enter_async_context(open_rig("tcp", network=network))
            await start_all(rig)
            found = await offset(rig, "stated by chrony")
            # the same way, the same midpoint: its statement is true, but no narrower by more than the link's
            # own part of a round trip, and as wrong in the middle
            assert abs(found.offset_ms) <= found.bound_ms
            assert abs(found.offset_ms) == pytest.approx(MIDPOINT_WRONG_MS, abs=5.0)
            assert found.bound_ms > 0.9 * HALF_TRIP_MS
            assert found.contradictions == 0

    on_this_host(story)


def judge_round_trip(found: OffsetMetrics) -> None:
    assert found.source == ROUND_TRIP
    assert found.bound_ms >= HALF_TRIP_MS - 1.0
    assert abs(found.offset_ms) == pytest.approx(MIDPOINT_WRONG_MS, abs=8.0)
    assert abs(found.offset_ms) <= found.bound_ms


def judge_known(found: OffsetMetrics) -> None:
    assert found.source == "chrony"
    assert abs(found.offset_ms) <= found.bound_ms < 2.0
    assert found.round_trip_bound_ms >= HALF_TRIP_MS - 1.0
    assert found.contradictions == 0


def judge_lie(found: OffsetMetrics) -> None:
    assert found.source == ROUND_TRIP
    assert found.contradictions > 0
    assert abs(found.offset_ms) <= found.bound_ms


@pytest.mark.skipif(not Path(PTP4L).exists(), reason="ptp4l is missing: apt install linuxptp")
def test_a_real_ptp4l_is_read(tmp_path: Path) -> None:
    """A grandmaster states its own scale; it never touches the clock (`free_running`)."""
    socket_path, file = tmp_path / "ptp4l", tmp_path / "ptp4l.conf"
    file.write_text(f"[global]\nfree_running 1\nuds_address {socket_path}\ndomainNumber 24\n", "utf-8")
    config = ClockConfig(source="ptp", ptp_socket=str(socket_path), ptp_domain=24)

    async def story() -> None:
        async with open_network("lan") as network:
            argv = [PTP4L, "-4", "-S", "-i", MANAGEMENT, "-f", str(file)]
            daemon = await asyncio.create_subprocess_exec(*network.robot.command(argv))
            try:
                services = TimeServices(config)
                for _ in range(30):
                    await asyncio.sleep(1.0)
                    await asyncio.to_thread(services.read)
                    if services.words.startswith("ptp states"):
                        break
                reference = services.track.reference(monotonic_ns())
                assert reference is not None, services.words
                assert reference.scale.startswith("ptp ")
                assert reference.error_ns < NS_PER_MS
                assert abs(reference.ahead_ns - (wall_ns() - monotonic_ns())) < NS_PER_MS
            finally:
                daemon.terminate()
                await daemon.wait()

    asyncio.run(story())
