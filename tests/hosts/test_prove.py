"""`tandem prove --lead` at a real master: a node on the hand of a real slave's robot judges both processes.

The node is a process of its own on the suit's bus. Made to be late, it must be found out: else the figures
would prove nothing.
"""

from __future__ import annotations

import asyncio
import json
import signal
import sys
import tempfile
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack, asynccontextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from common.clock import monotonic_ns
from common.errors import TandemError
from deploy.experiments.demo.options import DemoOptions
from deploy.harness.engage import EngageDriver, RigRobot, keep_engaged
from deploy.harness.host import HostWatch
from deploy.harness.operator import Operator, OperatorPatience
from deploy.harness.rig import ROBOT, Rig, open_rig
from deploy.harness.start import start_tracking
from deploy.measure.proof import ENCODER, HAND_TO_HAND, HAND_TO_SETPOINT, SERVO

if TYPE_CHECKING:
    from tests.conftest import OnThisHost

pytestmark = [pytest.mark.live, pytest.mark.timeout(900), pytest.mark.usefixtures("default_signals")]

SECONDS = "40"
"""Ten segments: a busy host leaves gaps in some, which then do not count."""
MOST_S = 400.0
"""Against a hang: on a busy host the figures alone take minutes."""
LATE_MS = 40


@asynccontextmanager
async def taped(rig: Rig, tap: Path, late_ms: int) -> AsyncIterator[None]:
    changes = [word for change in rig.overrides("master") for word in ("--set", change)]
    process = await asyncio.create_subprocess_exec(
        sys.executable, "-m", "deploy.sim.taped", str(rig.file("master")), str(tap), *changes,
        "--late-ms", str(late_ms),
    )  # fmt: skip
    try:
        yield
    finally:
        process.send_signal(signal.SIGTERM)
        await process.wait()


@asynccontextmanager
async def engaged_again(rig: Rig) -> AsyncIterator[None]:
    """The operator engages the robot again where it holds, as the guide asks of a person."""
    operator = Operator(ROBOT, OperatorPatience(), wanted_ns=monotonic_ns())
    driver = EngageDriver(operator, RigRobot(rig))
    task = asyncio.create_task(keep_engaged([driver], MOST_S, rig.check))
    try:
        yield
    finally:
        task.cancel()
        await asyncio.wait({task})


async def proved(within: Path, late_ms: int = 0) -> tuple[int, dict[str, dict[str, Any]], str]:
    """The status of the command, its rows by name, and what it said."""
    folder = Path(tempfile.mkdtemp(dir=within))
    said = folder / "said.txt"
    taps = {name: folder / f"{name}.sock" for name in ("master", "slave")}
    # pictures are no part of it: the robot of a busy host held for one that was late
    overrides = DemoOptions(camera=False).overrides()
    for name, tap in taps.items():
        overrides[name] = [*overrides.get(name, ()), f'tap.socket="{tap}"']
    async with AsyncExitStack() as stack:
        words = stack.enter_context(said.open("wb"))
        rig = await stack.enter_async_context(open_rig(overrides=overrides))
        await start_tracking(rig)
        await stack.enter_async_context(engaged_again(rig))
        await stack.enter_async_context(taped(rig, taps["slave"], late_ms))
        process = await asyncio.create_subprocess_exec(
            sys.executable, "-m", "deploy", "prove", "--lead", str(taps["master"]),
            "--out", str(folder / "proof.mcap"), "--seconds", SECONDS, "--json",
            stdout=asyncio.subprocess.PIPE, stderr=words,
        )  # fmt: skip
        try:
            async with asyncio.timeout(MOST_S):
                out, _ = await process.communicate()
        except TimeoutError:
            raise TandemError(f"not done within {MOST_S:g} s: {said.read_text()}") from None
        finally:
            if process.returncode is None:
                process.kill()
                await process.wait()
    rows = {row["name"]: row for row in json.loads(out)} if out else {}
    assert process.returncode is not None
    return process.returncode, rows, said.read_text()


def test_the_hand_of_a_real_slave_confirms_its_stamps(on_this_host: OnThisHost, tmp_path: Path) -> None:
    async def story(_: HostWatch) -> None:
        status, rows, said = await proved(tmp_path)
        assert status == 0, said
        for words in ("begin in 5", "move your right hand irregularly", "step 5 of 5"):
            assert words in said.lower()
        assert not rows[ENCODER]["why"]
        assert rows[ENCODER]["bound_ms"] < 15.0
        assert rows[ENCODER]["found_ms"] == pytest.approx(0.0, abs=5.0)
        assert not rows[ENCODER]["wrong"]
        total_ms = rows[HAND_TO_SETPOINT]["found_ms"] + rows[SERVO]["found_ms"]
        assert rows[HAND_TO_HAND]["found_ms"] == pytest.approx(total_ms, abs=8.0)
        assert 20.0 < rows[SERVO]["found_ms"] < 45.0
        assert rows[HAND_TO_HAND]["claimed_ms"] > 0.0, "sampled → moved, by the robot's own figures"

    on_this_host(story)


def test_a_node_whose_time_is_wrong_does_not_confirm_them(on_this_host: OnThisHost, tmp_path: Path) -> None:
    async def story(_: HostWatch) -> None:
        status, rows, said = await proved(tmp_path, LATE_MS)
        assert status == 1, said
        assert rows[ENCODER]["wrong"]
        assert rows[ENCODER]["found_ms"] == pytest.approx(-LATE_MS, abs=8.0)

    on_this_host(story)
