"""Two hosts of namespaces: who reaches whom, what the link counts, and that nothing stays behind."""

from __future__ import annotations

import asyncio
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress

import psutil
import pytest

from common.errors import NetworkError
from deploy.ops.network.verify import measure
from deploy.sim.network import Profile, load_profile, open_network
from deploy.sim.network.host import EmulatedHost
from deploy.sim.network.namespaces import ip, parse_run, remove_dead

ANSWER = """
import socket, sys
with socket.create_server((sys.argv[1], 7000)) as server:
    print("up", flush=True)
    server.accept()[0].sendall(b"here")
"""
REACH = """
import socket, sys
socket.create_connection((sys.argv[1], 7000), 2.0)
"""
OPEN = """
import asyncio, sys
from deploy.sim.network import open_network
async def main():
    async with open_network("lan") as network:
        print(network.operator.namespace, flush=True)
        await asyncio.Event().wait()
asyncio.run(main())
"""
QUIET = Profile.model_validate({"name": "quiet", "both": {"delay_ms": 5.0}})


def namespaces() -> set[str]:
    return {line.split()[0] for line in ip("netns", "list").splitlines()}


def veths_of(run: str) -> list[str]:
    return [line for line in ip("link").splitlines() if run in line]


async def answers(host: EmulatedHost, address: str) -> bytes:
    """What somebody in the caller's namespace hears from a program on the host."""
    process = await asyncio.create_subprocess_exec(
        *host.command([sys.executable, "-c", ANSWER, address]), stdout=asyncio.subprocess.PIPE
    )
    try:
        assert process.stdout is not None
        assert await process.stdout.readline() == b"up\n"
        reader, writer = await asyncio.open_connection(host.management, 7000)
        said = await reader.read()
        writer.close()
        return said
    finally:
        with suppress(ProcessLookupError):
            process.kill()
        await process.wait()


async def reached(host: EmulatedHost, address: str) -> str:
    """What went wrong when a program on the host called another address."""
    process = await asyncio.create_subprocess_exec(
        *host.command([sys.executable, "-c", REACH, address]), stderr=asyncio.subprocess.PIPE
    )
    _, failed = await process.communicate()
    return failed.decode()


def test_the_caller_reaches_both_hosts_and_they_each_other_by_the_link() -> None:
    async def story() -> None:
        async with open_network(QUIET) as network:
            for host in (network.operator, network.robot):
                assert await answers(host, host.management) == b"here"
            assert network.counters().to_robot.packets == 0  # none of that crossed the link
            assert "unreachable" in await reached(network.operator, network.robot.management)
            measured = await measure(network, 1.0)
            assert measured.to_robot.received == measured.to_operator.received == 200
            assert measured.kept, measured.tree()
            counted = network.counters()
            assert (counted.to_robot.packets, counted.to_operator.packets) == (200, 200)
            assert counted.to_robot.bytes == counted.to_robot.delivered_bytes == 200 * 128

    asyncio.run(story())


def test_the_link_is_cut_restored_and_changed_while_it_runs() -> None:
    async def story() -> None:
        async with open_network(QUIET, backend="forwarder") as network:
            network.cut()
            with pytest.raises(NetworkError, match="none of 40 packets came through"):
                await measure(network, 0.2)
            network.restore()
            assert (await measure(network, 0.5)).to_robot.received == 100
            assert network.counters().to_robot.dropped == {"loss": 0, "queue": 0, "size": 0, "outage": 40}
            network.set(Profile.model_validate({"both": {"delay_ms": 40.0}}))
            measured = await measure(network, 0.5)
            assert measured.to_operator.p50_ms == pytest.approx(40.0, abs=1.0)

    asyncio.run(story())


def test_scripted_outages_happen_and_end_with_the_profile() -> None:
    always = {"both": {"delay_ms": 5.0}, "outages": [{"at_s": 0.0, "for_s": 60.0}]}

    async def story() -> None:
        async with open_network(Profile.model_validate(always), backend="forwarder") as network:
            await asyncio.sleep(0)  # the script begins
            with pytest.raises(NetworkError, match="none of"):
                await measure(network, 0.2)
            network.set(QUIET)
            assert (await measure(network, 0.2)).to_robot.received == 40

    asyncio.run(story())


@pytest.mark.parametrize("name", ["4g", "adsl"])
def test_a_profile_is_kept(name: str) -> None:
    async def story() -> None:
        async with open_network(load_profile(name), backend="forwarder") as network:
            measured = await measure(network, 3.0)
            assert measured.kept, measured.tree()
            assert measured.to_robot.reordered_percent == measured.to_operator.reordered_percent == 0.0
            assert network.counters().to_robot.dropped["queue"] > 0  # when more was sent than it takes

    asyncio.run(story())


def test_an_error_within_leaves_nothing_behind() -> None:
    async def story() -> str:
        async with open_network(QUIET) as network:
            name = network.operator.namespace
            assert name in namespaces()
            await asyncio.create_subprocess_exec(*network.robot.command(["sleep", "1000"]))
            raise ValueError(name)

    with pytest.raises(ValueError, match="tandem-") as failed:
        asyncio.run(story())
    run = parse_run(str(failed.value))
    assert run is not None
    assert not any(run.name in each for each in [*namespaces(), *veths_of(run.name)])


@contextmanager
def started() -> Iterator[tuple[subprocess.Popen[str], str]]:
    """A process that has opened a network, and the operator's namespace; it has ended afterwards."""
    process = subprocess.Popen([sys.executable, "-c", OPEN], stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        yield process, process.stdout.readline().strip()
    finally:
        process.kill()
        process.communicate(timeout=30)


@pytest.mark.usefixtures("default_signals")
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGKILL, signal.SIGINT])
def test_a_caller_that_is_killed_leaves_nothing_behind(number: signal.Signals) -> None:
    with started() as (process, namespace):
        assert namespace in namespaces()
        process.send_signal(number)
        # the janitor has inherited the output: it ends when the janitor does
        process.communicate(timeout=30)
    assert namespace not in namespaces()
    assert not veths_of(namespace.rpartition("-")[0])


def test_what_a_dead_run_left_is_removed_by_the_next() -> None:
    with started() as (process, namespace):
        run = parse_run(namespace)
        assert run is not None
        assert run.name not in remove_dead()  # it lives
        for child in psutil.Process(process.pid).children():
            if "deploy.sim.network.janitor" in child.cmdline():
                child.kill()
    assert namespace in namespaces()
    assert run.name in remove_dead()
    assert namespace not in namespaces()
    assert not veths_of(run.name)


def test_two_networks_at_once_do_not_meet() -> None:
    async def story() -> None:
        async with open_network(QUIET) as one, open_network(QUIET) as other:
            assert len({one.operator.management, other.operator.management}) == 2
            first, second = await asyncio.gather(measure(one, 0.5), measure(other, 0.5))
            assert first.to_robot.received == second.to_robot.received == 100
            assert one.counters().to_robot.packets == 100

    asyncio.run(story())
