"""A robot changes hands while everything runs: two masters, one slave, and a person's two commands."""

from __future__ import annotations

import asyncio
import os
import sys
from asyncio.subprocess import PIPE, STDOUT
from contextlib import AsyncExitStack
from pathlib import Path

import pytest

from deploy.examples.profiles import example
from tests.link.parties import free_port, reached, started

pytestmark = pytest.mark.live


async def tandem(*arguments: str) -> tuple[int, str]:
    """A person's command: its exit status and what it says."""
    child = await asyncio.create_subprocess_exec(
        sys.executable,
        "-m",
        "deploy",
        *arguments,
        stdout=PIPE,
        stderr=STDOUT,
        env={**os.environ, "COLUMNS": "200"},
    )
    said, _ = await child.communicate()
    assert child.returncode is not None
    return child.returncode, " ".join(said.decode().split())


def test_a_running_master_takes_over_without_a_restart(tmp_path: Path) -> None:
    at = f"tcp/127.0.0.1:{free_port('tcp')}"
    where = ("--connect", at, "--robot", "robot-1")
    usual = ("--set", "process.realtime_priority=0", "--set")

    async def story() -> None:
        async with AsyncExitStack() as stack:
            slave = await stack.enter_async_context(
                started(
                    "-m", "slave", str(example("slave")), *usual, f'link.listen=["{at}"]', until="waiting for"
                )
            )
            masters = {}
            for number in ("1", "2"):
                port = free_port("udp")
                masters[number] = await stack.enter_async_context(
                    started(
                        "-m", "master", str(example("master")), *usual, f'link.connect=["{at}"]', "--set",
                        f'operator.name="nurse-{number}"', "--set", f"capture.buses.0.options.port={port}",
                        until="nurse-1 holds the lease",
                    )
                )  # fmt: skip
            offered = await tandem("handover", "--to", "nurse-2", *where, "--operator", "nurse-1")
            assert offered[0] == 0, offered
            assert "nurse-2 may take over now" in offered[1]
            taken = "nurse-2 holds the lease now; engage to move"
            await reached(lambda: masters["2"].said(taken), masters["2"], taken)
            _, said = await tandem("status", *where)
            assert "nurse-2 took over from nurse-1; waits for nurse-2 to engage" in said
            again = await tandem("handover", "--to", "nurse-1", *where, "--operator", "nurse-1")
            assert "nurse-2 holds the lease" in again[1]
            back = await tandem("handover", "--to", "nurse-1", *where, "--operator", "nurse-2")
            assert back[0] == 0, back
            await reached(
                lambda: sum("nurse-1 holds the lease now" in line for line in masters["1"].log) == 2,
                masters["1"], "nurse-1's lease once more",
            )  # fmt: skip
            assert slave.process.returncode is None

    asyncio.run(story())
