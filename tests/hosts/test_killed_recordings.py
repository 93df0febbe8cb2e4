"""Ten recorders killed with -9 at any moment: every file can be read, and lacks at most its last second."""

from __future__ import annotations

import asyncio
import random
import signal
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import msgpack
import pytest

from common.clock import monotonic_ns, to_s
from common.recording import read_recording
from common.tap.sender import TapSender
from deploy.harness.host import HostWatch

if TYPE_CHECKING:
    from tests.conftest import OnThisHost

pytestmark = [pytest.mark.live, pytest.mark.timeout(300)]
TOGETHER, RECORDERS = 4, 10
FRAME_BYTES = 1200
"""A tick of 36 nodes; it does not compress."""
MOST_LOST_S = 1.0


async def killed(sender: TapSender, out: Path, after_s: float) -> tuple[Path, int]:
    """A recorder that is killed some time after its file is there; when, by this host's clock."""
    process = await asyncio.create_subprocess_exec(
        sys.executable, "-m", "deploy", "record", "--tap", str(sender.path), "--out", str(out),
        stdout=asyncio.subprocess.DEVNULL, stderr=asyncio.subprocess.DEVNULL,
    )  # fmt: skip
    async with asyncio.timeout(60.0):
        while True:
            if await asyncio.to_thread(out.exists):
                break
            await asyncio.sleep(0.02)
    await asyncio.sleep(after_s)
    process.send_signal(signal.SIGKILL)
    at_ns = monotonic_ns()
    await process.wait()
    return out, at_ns


def test_ten_recordings_killed_at_any_moment(on_this_host: OnThisHost, tmp_path: Path) -> None:
    async def story(host: HostWatch) -> None:
        folder = tmp_path / f"{monotonic_ns()}"
        folder.mkdir()
        sender = TapSender(folder / "s.sock", lambda: msgpack.packb({"role": "master"}))
        sender.open()
        draw = random.Random(7)

        async def feed() -> None:
            number = 0
            while True:
                number += 1
                sender.put("suit/frames", draw.randbytes(FRAME_BYTES), monotonic_ns())
                await asyncio.sleep(0.005)

        feeding = asyncio.create_task(feed())
        found: list[tuple[Path, int]] = []
        for begin in range(0, RECORDERS, TOGETHER):
            several = range(begin, min(begin + TOGETHER, RECORDERS))
            killings = [killed(sender, folder / f"{i}.mcap", draw.uniform(0.6, 3.0)) for i in several]
            found += await asyncio.gather(*killings)
        feeding.cancel()
        sender.close()
        for path, at_ns in found:
            recording = read_recording(path)
            assert recording.metadata["role"] == "master"
            assert recording.entries, path
            lost_s = to_s(at_ns - recording.entries[-1].monotonic_ns)
            assert 0.0 <= lost_s <= MOST_LOST_S, f"{path.name} lacks {lost_s:.2f} s"

    on_this_host(story)
