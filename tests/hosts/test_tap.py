"""The taps of a real master and slave: recorders are killed, readers stall, and nothing is held up."""

from __future__ import annotations

import asyncio
import itertools
import json
import signal
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest

from common.clock import to_s
from common.recording import McapRecording, read_recording
from common.tap.reader import TapReader
from common.wire.codec import decode
from common.wire.messages import RobotState
from deploy.harness.engage import until_tracking
from deploy.harness.host import HostWatch
from deploy.harness.rig import ROBOT, Rig, open_rig
from deploy.harness.spawn import finished
from deploy.harness.start import start_all
from deploy.recorded.recompute import Recorded, Replay
from deploy.recorded.recorded_config import recorded_config
from master.journal.calls import FRAMES
from slave.tap import TICK, decode_tick

if TYPE_CHECKING:
    from tests.conftest import OnThisHost

pytestmark = [pytest.mark.live, pytest.mark.timeout(400)]


async def recorder(socket: Path, out: Path) -> asyncio.subprocess.Process:
    return await asyncio.create_subprocess_exec(
        sys.executable, "-m", "deploy", "record", "--tap", str(socket), "--out", str(out),
        stdout=asyncio.subprocess.DEVNULL, stderr=asyncio.subprocess.DEVNULL,
    )  # fmt: skip


async def killed_after(rig: Rig, process: asyncio.subprocess.Process, out: Path, states: int) -> None:
    """Kill -9 once so many states have come since there was something in the file."""
    await rig.until(lambda: out.exists() and out.stat().st_size > 10_000, 60.0, "a recording")
    seen = len(rig.observer.states)
    await rig.until(lambda: len(rig.observer.states) >= seen + states, 60.0, "states")
    process.send_signal(signal.SIGKILL)
    await process.wait()


def test_recordings_at_the_taps_survive_a_kill_and_are_computed_again_bit_for_bit(
    on_this_host: OnThisHost, tmp_path: Path
) -> None:
    sockets = {role: tmp_path / f"{role}.sock" for role in ("master", "slave")}

    tries = itertools.count()

    async def story(host: HostWatch) -> None:
        attempt = next(tries)
        files = {role: tmp_path / f"{role}-{attempt}.mcap" for role in sockets}
        overrides = {role: [f'tap.socket="{path}"'] for role, path in sockets.items()}
        async with open_rig(overrides=overrides) as rig:
            await start_all(rig)
            await until_tracking(rig, ROBOT)
            rig.observer.recording = True
            with TapReader(sockets["master"]), TapReader(sockets["slave"]):  # they never read
                processes = {role: await recorder(sockets[role], files[role]) for role in sockets}
                for number, (role, process) in enumerate(processes.items()):
                    await killed_after(rig, process, files[role], 400 + 37 * number)
            await until_tracking(rig, ROBOT)
        check_master(read_recording(files["master"]))
        check_slave(read_recording(files["slave"]))
        await check_commands(files["master"], files["slave"], tmp_path / f"out-{attempt}")

    on_this_host(story)


async def check_commands(master: Path, slave: Path, out: Path) -> None:
    """What a person runs on such files, each to its end; the stages of jitter are all there."""
    await asyncio.to_thread(out.mkdir)
    for arguments in (
        ("replay", master, "--check"),
        ("inspect", slave, "--plots", out / "plots"),
        ("export", slave, "--to", "foxglove", "--out", out / "view.mcap"),
        ("export", slave, "--to", "parquet", "--out", out / "all.parquet"),
        ("export", slave, "--to", "bids", "--out", out / "study"),
    ):
        status, _, error = await run_command(arguments)
        assert status == 0, (arguments, error)
    status, text, error = await run_command(("inspect", master, slave, "--jitter", "--json"))
    assert status == 0, error
    stages = [stage["stage"] for stage in json.loads(text)["jitter"]["stages"]]
    assert stages == ["nodes", "fused", "solved", "received", "tracked", "limited", "encoders"]


async def run_command(arguments: Sequence[object]) -> tuple[int, str, str]:
    status, text, error = await finished([sys.executable, "-m", "deploy", *map(str, arguments)])
    return status, text.decode(), error.decode()


def check_master(recording: McapRecording) -> None:
    entries = [Recorded(entry.topic, entry.payload) for entry in recording.entries]
    with recorded_config(recording.metadata, "master.mcap") as config:
        replay = Replay(config)
        pairs = list(replay.pairs(entries))
    assert len(pairs) > 20
    assert all(pair.identical for pair in pairs)
    assert replay.ticks > 300


def check_slave(recording: McapRecording) -> None:
    ticks = [decode_tick(entry.payload) for entry in recording.entries if entry.topic == TICK]
    by_read = {tick.read_ns: tick for tick in ticks}
    states = [e.payload for e in recording.entries if e.topic.endswith("/state")]
    compared = 0
    for payload in states:
        state = decode(payload, RobotState, 25)
        tick = by_read.get(state.encoder_ns)
        if tick is not None:
            np.testing.assert_allclose(tick.position_rad, state.position_rad, atol=1e-6)
            compared += 1
    assert compared > 50
    assert to_s(ticks[-1].now_ns - ticks[0].now_ns) > 1.0
    assert {FRAMES}.isdisjoint(entry.topic for entry in recording.entries)
