"""A link whose other end vanishes without a word, in a network namespace whose only interface goes down."""

import shutil
import subprocess
import sys

import pytest

NAMESPACE = ["unshare", "--map-root-user", "--net"]
PROGRAM = """
import asyncio, subprocess, sys
from common.clock import monotonic_ns
from common.link.config import LinkConfig
from common.link import open_link
from common.process.runtime import run
from common.wire.topics import COMMAND

ENDPOINT = sys.argv[1] + "/127.0.0.1:7447"

async def listen(stop):
    async with open_link(LinkConfig(listen=[ENDPOINT]), "robot-1") as link:
        link.subscribe(COMMAND, lambda payload, arrived_ns: None)
        print("up", flush=True)
        await stop.wait()

async def connect(stop):
    link_open = open_link(LinkConfig(connect=[ENDPOINT]), "robot-1")
    link = await link_open.__aenter__()
    await link.connected()
    publish = link.publish(COMMAND.of("anna"))
    publish(bytes(300))
    subprocess.run(["ip", "link", "set", "lo", "down"], check=True)
    worst_ns = 0
    for _ in range(20):
        begun_ns = monotonic_ns()
        publish(bytes(300))
        worst_ns = max(worst_ns, monotonic_ns() - begun_ns)
        await asyncio.sleep(0.01)
    begun_ns = monotonic_ns()
    await link_open.__aexit__(None, None, None)
    print(worst_ns / 1e9, (monotonic_ns() - begun_ns) / 1e9)

if sys.argv[2] == "listen":
    run(listen)
else:
    subprocess.run(["ip", "link", "set", "lo", "up"], check=True)
    other = [sys.executable, "-c", sys.argv[3], sys.argv[1], "listen"]
    child = subprocess.Popen(other, stdout=subprocess.PIPE)
    try:
        child.stdout.readline()
        run(connect)
    finally:
        child.kill()
        child.wait()
"""


def namespaces() -> bool:
    if not (shutil.which("unshare") and shutil.which("ip")):
        return False
    return subprocess.run([*NAMESPACE, "true"], capture_output=True, check=False).returncode == 0


@pytest.mark.live
@pytest.mark.skipif(
    not namespaces(), reason="needs `unshare` and `ip`, and leave to make a network namespace"
)
@pytest.mark.parametrize("protocol", ["tcp", "udp", "ws"])
def test_no_put_stalls_and_the_process_ends_in_time(protocol: str) -> None:
    done = subprocess.run(
        [*NAMESPACE, sys.executable, "-c", PROGRAM, protocol, "connect", PROGRAM],
        capture_output=True, text=True, timeout=30, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    worst_put_s, close_s = map(float, done.stdout.split())
    assert worst_put_s < 0.5  # it was 5 s with congestion control that blocks
    assert close_s < 2.0  # 10 s if it were waited for
