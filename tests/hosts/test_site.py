"""docs/deployment.md done by a machine: keys, a robot's and an operator's host, doctor, engage, stop."""

from __future__ import annotations

import asyncio
import json
import shutil
import sys
import tempfile
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from common.link.roles import Role
from deploy import cli
from deploy.certificates import REVOKED
from deploy.certificates.folder import stem, write_pair
from deploy.certificates.make import new_authority, new_identity
from deploy.harness.child import Child
from deploy.harness.host import HostWatch
from deploy.sim.network import EmulatedHost
from deploy.sim.network.namespaces import why_not
from deploy.sim.network.network import open_network
from master.suit.protocol import SHIPPED_DBC

if TYPE_CHECKING:
    from tests.conftest import OnThisHost

pytestmark = [pytest.mark.live, pytest.mark.timeout(600)]

ALIGN_S, LOOK_S = 30.0, 0.1
REVOKED_S = 10.0
"""Far more than the second within which the list is read: the host is busy."""

DEPLOY = Path(cli.__file__).parent
TANDEM = [sys.executable, "-m", "deploy"]
BUS = 'interface="udp_multicast"', 'channel="239.74.163.2"', "options={ port = 43119, hop_limit = 0 }"


def a_site(folder: Path, robot_at: str) -> None:
    """The files of `deploy/examples/site`, with the robot's true address, and the keys that they name."""
    for file in (DEPLOY / "examples" / "site").glob("*.toml"):
        (folder / file.name).write_text(file.read_text("utf-8").replace("192.168.7.2", robot_at), "utf-8")
    shutil.copy(SHIPPED_DBC, folder)
    now, valid, keys = datetime.now(UTC), timedelta(days=365), folder / "keys"
    keys.mkdir()
    authority = new_authority("test", now, valid)
    write_pair(keys, "ca", authority)
    (keys / REVOKED).write_text("")
    for role, name, hosts in ((Role.ROBOT, "robot-1", [robot_at]), (Role.OPERATOR, "nurse-1", [])):
        write_pair(keys, stem(role, name), new_identity(authority, role, name, hosts, now, valid))


async def tandem(host: EmulatedHost, *arguments: str) -> tuple[int | None, str]:
    """Type a command at a host; its status and what it printed."""
    process = await asyncio.create_subprocess_exec(
        *host.command([*TANDEM, *arguments]), stdout=asyncio.subprocess.PIPE, stderr=asyncio.subprocess.STDOUT
    )
    said, _ = await process.communicate()
    return process.returncode, said.decode()


async def until(reached: Callable[[Any], bool], host: EmulatedHost, operator: Path) -> Any:
    """Ask for the robot's status until it is as wanted."""
    for _ in range(30):
        _, said = await tandem(host, "status", "--master", str(operator), "--json")
        status = json.loads(said[: said.rindex("}") + 1])["robot-1"]
        if reached(status):
            return status
    raise AssertionError(f"not reached: {status}")


async def follow(host: EmulatedHost, operator: Path, robot: Child) -> None:
    """Engage, and let it align undisturbed until it tracks: each command typed takes a core for a while."""
    said = ""
    for _ in range(3):
        before = len(robot.log_text())
        _, said = await tandem(host, "engage", "--master", str(operator))
        for _ in range(round(ALIGN_S / LOOK_S)):
            if ": track: " in robot.log_text()[before:]:
                status = await until(lambda s: s["guard"] in ("hold", "track"), host, operator)
                assert status["guard"] == "track", status
                return
            if ": hold: " in robot.log_text()[before:]:
                break
            await asyncio.sleep(LOOK_S)
    raise AssertionError(f"never tracked: {said}; {robot.last_lines()}")


def test_from_keys_to_a_robot_that_follows_in_two_hosts(tmp_path: Path, on_this_host: OnThisHost) -> None:
    reason = why_not()
    if reason is not None:
        pytest.skip(reason)

    async def story(_: HostWatch) -> None:
        folder = Path(tempfile.mkdtemp(dir=tmp_path))  # of this try
        async with open_network("lan") as network:
            a_site(folder, network.robot.address)
            operator, overrides = folder / "operator.toml", [f"capture.buses.0.{key}" for key in BUS]
            at_robot = Child("slave", folder, network.robot.command(TANDEM))
            at_operator = [
                Child(role, folder, network.operator.command(TANDEM)) for role in ("suit", "master")
            ]
            suit, master = at_operator
            try:
                await at_robot.start(folder / "robot.toml", ['camera.source="off"'])
                await suit.start(
                    DEPLOY / "examples" / "suit.toml", ["link.connect=[]", *(f"buses.0.{key}" for key in BUS)]
                )
                await master.start(operator, overrides)
                await until(lambda s: s["operator"] == "nurse-1", network.operator, operator)

                overriding = [part for override in overrides for part in ("--set", override)]
                status, said = await tandem(
                    network.operator, "doctor", str(operator), "--json", *overriding
                )  # fmt: skip
                assert status == 0, said
                checks = {check["check"]: check for check in json.loads(said)["checks"]}
                for check in ("certificate's name", "certificate's time", "robot-1", "robot-1: versions"):
                    assert checks[check]["health"] == "ok", checks[check]
                assert "offset" in checks["robot-1: clock"]["found"]

                await follow(network.operator, operator, at_robot)
                status, said = await tandem(
                    network.operator, "keys", "revoke", str(folder / "keys"), "operator:nurse-1"
                )
                assert status == 0, said
                for _look in range(round(REVOKED_S / LOOK_S)):
                    if ": hold: the certificate of nurse-1 is revoked" in at_robot.log_text():
                        break
                    await asyncio.sleep(LOOK_S)
                else:
                    raise AssertionError(f"follows a revoked operator: {at_robot.last_lines()}")
                status, said = await tandem(network.operator, "engage", "--master", str(operator))
                assert status != 0, said
            finally:
                statuses = [await child.stop() for child in (master, suit, at_robot)]
        assert statuses == [0, 0, 0], at_robot.last_lines()

    on_this_host(story)
