"""Real, tiny processes: how they end is told. That Zenoh's threads hold no start up: tests/hosts."""

from __future__ import annotations

import asyncio
import signal
import sys
from pathlib import Path

import pytest

from deploy.harness.spawn import Spawned, finished


def test_its_output_and_its_status_are_told(tmp_path: Path) -> None:
    async def story() -> None:
        path = tmp_path / "log"
        with path.open("wb") as log:
            process = Spawned([sys.executable, "-c", "print('said'); raise SystemExit(3)"], log)
        assert await process.wait() == 3
        assert (process.returncode, await process.wait()) == (3, 3)
        assert path.read_text() == "said\n"

    asyncio.run(story())


@pytest.mark.usefixtures("default_signals")
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGKILL])
def test_one_that_is_sent_a_signal_ends_by_it(tmp_path: Path, number: signal.Signals) -> None:
    async def story() -> None:
        with (tmp_path / "log").open("wb") as log:
            process = Spawned(["sleep", "60"], log)
        try:
            assert process.returncode is None
            process.send_signal(number)
            assert await asyncio.wait_for(process.wait(), 10) == -number
        finally:
            process.kill()

    asyncio.run(story())


def test_a_wait_that_is_given_up_can_be_begun_again(tmp_path: Path) -> None:
    async def story() -> None:
        with (tmp_path / "log").open("wb") as log:
            process = Spawned(["sleep", "60"], log)
        try:
            with pytest.raises(TimeoutError):
                await asyncio.wait_for(process.wait(), 0.01)
        finally:
            process.kill()
        assert await process.wait() == -signal.SIGKILL

    asyncio.run(story())


def test_a_short_command_is_run_to_its_end() -> None:
    command = ["sh", "-c", "echo out; echo err >&2; exit 4"]
    assert asyncio.run(finished(command)) == (4, b"out\n", b"err\n")
    with pytest.raises(FileNotFoundError):
        asyncio.run(finished(["there is no such program"]))
