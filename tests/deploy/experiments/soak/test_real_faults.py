"""The faults that the kernel itself brings about: a stepped clock, a full disk; skipped where we may not."""

from __future__ import annotations

import asyncio
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from common.clock import NS_PER_S, monotonic_ns
from deploy.experiments.soak import clock_step
from deploy.experiments.soak.recorder import FULL_BYTES, SmallDisk

NOW = [sys.executable, "-c", "from common.clock import monotonic_ns; print(monotonic_ns())"]


def test_a_process_s_clock_is_really_stepped_and_the_host_s_is_not() -> None:
    why_not = asyncio.run(clock_step.why_not())
    if why_not:
        pytest.skip(why_not)
    before_ns = monotonic_ns()
    said = subprocess.run([*clock_step.through(3600), *NOW], capture_output=True, text=True, check=True)
    stepped_ns = int(said.stdout) - 3600 * NS_PER_S
    assert before_ns <= stepped_ns <= monotonic_ns()


def test_a_host_without_the_tool_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "")
    assert "a clock is stepped by `unshare --time`: No such file" in asyncio.run(clock_step.why_not())


def test_a_kernel_that_ignores_the_step_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(clock_step, "through", lambda _: ("env",))
    assert "leaves the clock as it is" in asyncio.run(clock_step.why_not())


def test_a_refusal_is_told_in_the_tool_s_own_words(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(clock_step, "through", lambda _: ("sh", "-c", "echo not permitted >&2; exit 1"))
    assert "is refused: not permitted" in asyncio.run(clock_step.why_not())


def test_a_small_disk_is_full_and_can_be_removed(tmp_path: Path) -> None:
    async def story() -> None:
        disk = SmallDisk(tmp_path / "full")
        folder, through, how = await disk.make()
        if through:
            pytest.skip(how)
        try:
            with pytest.raises(OSError, match="No space left"):
                (folder / "file").write_bytes(bytes(2 * FULL_BYTES))
        finally:
            await disk.remove()
        assert not (tmp_path / "full").exists()
        await disk.remove()

    asyncio.run(story())


def test_where_nothing_may_be_mounted_the_files_are_limited(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def refuses(*_: str) -> bool:
        return False

    if not shutil.which("prlimit"):
        pytest.skip("there is no prlimit")
    monkeypatch.setattr("deploy.experiments.soak.recorder._succeeds", refuses)
    folder, through, how = asyncio.run(SmallDisk(tmp_path / "full").make())
    assert "nothing may be mounted" in how
    fill = f"open({str(folder / 'file')!r}, 'wb', buffering=0).write(bytes({2 * FULL_BYTES}))"
    subprocess.run([*through, sys.executable, "-c", fill], check=True)
    assert (folder / "file").stat().st_size == FULL_BYTES
