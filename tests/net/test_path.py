"""A path that swallows packets above 1280 bytes, as many tunnels do: the doctor's probes find it over tcp."""

from __future__ import annotations

import asyncio
import sys
from contextlib import suppress

import pytest

from deploy.sim.network import Profile, open_network
from deploy.sim.network.host import EmulatedHost
from deploy.sim.network.namespaces import why_not

pytestmark = [pytest.mark.net, pytest.mark.skipif(bool(why_not()), reason=str(why_not()))]

ROBOT = """
import asyncio, sys
from common.link.config import LinkConfig
from common.link import open_session
from common.wire.path_probe import answer_probe
from common.wire.topics import PATH
async def main():
    async with open_session(LinkConfig(listen=[sys.argv[1]])) as session:
        session.link("robot-1").answer(PATH, lambda question, _: answer_probe(question))
        print("here", flush=True)
        await asyncio.sleep(120)
asyncio.run(main())
"""
OPERATOR = """
import asyncio, sys
from common.link.config import LinkConfig
from deploy.ops.doctor.read.path import read_path
facts = asyncio.run(read_path(LinkConfig(connect=[sys.argv[1]]), "robot-1", (1100, 1350)))
print(facts.there_bytes, facts.back_bytes, flush=True)
"""


async def _start(host: EmulatedHost, script: str, endpoint: str) -> asyncio.subprocess.Process:
    command = host.command([sys.executable, "-c", script, endpoint])
    return await asyncio.create_subprocess_exec(*command, stdout=asyncio.subprocess.PIPE)


@pytest.mark.parametrize(("largest_bytes", "found"), [(None, (1350, 1350)), (1280, (1100, 1100))])
def test_what_a_path_swallows_is_found(largest_bytes: int | None, found: tuple[int, int]) -> None:
    async def story() -> None:
        profile = Profile.model_validate({"both": {"delay_ms": 2.0, "largest_bytes": largest_bytes}})
        async with open_network(profile, backend="forwarder") as network:
            endpoint = f"tcp/{network.robot.address}:7447"
            robot = await _start(network.robot, ROBOT, endpoint)
            try:
                assert robot.stdout is not None
                assert await robot.stdout.readline() == b"here\n"
                operator = await _start(network.operator, OPERATOR, endpoint)
                try:
                    said, _ = await asyncio.wait_for(operator.communicate(), 60)
                finally:
                    with suppress(ProcessLookupError):
                        operator.kill()
                    await operator.wait()
                assert tuple(map(int, said.split())) == found
                swallowed = network.counters().to_robot.dropped["size"]
                assert (swallowed > 0) == (largest_bytes is not None)
            finally:
                with suppress(ProcessLookupError):
                    robot.kill()
                await robot.wait()

    asyncio.run(story())
