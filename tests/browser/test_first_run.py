"""README's way from the first look to data of one's own: demo, page, stop, replay, inspect, export."""

from __future__ import annotations

import asyncio
import re
import shlex
import signal
import sys
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from common.clock import monotonic_ns
from deploy.harness.host import HostWatch
from tests.browser.console.browser import ARGUMENTS, CHROMIUM

if TYPE_CHECKING:
    from tests.conftest import OnThisHost

playwright_api = pytest.importorskip("playwright.async_api", reason="the extra `browser` is not installed")
parquet = pytest.importorskip("pyarrow.parquet", reason="the extra `export` is not installed")
pytestmark = [
    pytest.mark.live,
    pytest.mark.timeout(400),
    pytest.mark.usefixtures("default_signals"),
    pytest.mark.skipif(CHROMIUM is None, reason="no chromium here: apt install chromium"),
]
ROOT = Path(__file__).parents[2]
FOLDER = "first-run"
ESTOP = "estop"


def readme_lines() -> list[str]:
    """The four commands, without their comments."""
    text = (ROOT / "README.md").read_text("utf-8")
    lines = [line.partition(" #")[0].strip() for line in text.splitlines() if f" {FOLDER}" in line]
    return [line for line in lines if line.startswith(("make demo", ".venv/bin/tandem"))]


def arguments(line: str, folder: Path) -> list[str]:
    """What `tandem` gets of such a line, in a folder of the test's own."""
    made = re.sub(r'^make demo ARGS="(.*)"$', r"tandem demo \1", line)
    return shlex.split(made.replace(FOLDER, str(folder)))[1:]


@asynccontextmanager
async def running(arguments: list[str]) -> AsyncIterator[asyncio.subprocess.Process]:
    process = await asyncio.create_subprocess_exec(
        sys.executable, "-m", "deploy", *arguments, stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.STDOUT, cwd=ROOT,
    )  # fmt: skip
    try:
        yield process
    finally:
        if process.returncode is None:
            process.kill()
            await process.wait()


async def printed(process: asyncio.subprocess.Process, wanted: str) -> str:
    """What follows some words on a line of its output."""
    assert process.stdout is not None
    heard = []
    async with asyncio.timeout(120.0):
        while line := (await process.stdout.readline()).decode(errors="replace"):
            heard.append(line)
            if wanted in line:
                return line.partition(wanted)[2].strip()
    raise AssertionError(f"no {wanted!r} in:\n{''.join(heard)}")


async def done(line: str, folder: Path) -> str:
    async with running(arguments(line, folder)) as process:
        said, _ = await process.communicate()
        assert process.returncode == 0, said.decode()
        return said.decode()


async def stop_on_the_page(address: str) -> None:
    async with playwright_api.async_playwright() as playwright:
        browser = await playwright.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
        page: Any = await browser.new_page(locale="en-GB")
        await page.goto(address)
        await page.wait_for_selector("body[data-state=follows]", timeout=60_000)
        await page.keyboard.press("Escape")
        await page.wait_for_selector("body[data-state=stopped]", timeout=60_000)
        # the robot stands, and a recorder flushes within a second
        await page.wait_for_timeout(1500)
        await browser.close()


def test_from_the_first_look_to_data_of_ones_own(on_this_host: OnThisHost, tmp_path: Path) -> None:
    async def story(host: HostWatch) -> None:
        folder = tmp_path / f"run-{monotonic_ns()}"
        demo, replay, inspect, export = readme_lines()
        async with running(arguments(demo, folder)) as process:
            address = await printed(process, "web page: ")
            await printed(process, "robot-1 follows")
            await stop_on_the_page(address)
            process.send_signal(signal.SIGINT)
            assert process.stdout is not None
            rest = await process.stdout.read()
            assert await process.wait() == 0, rest.decode()
        again = await done(replay, folder)
        match = re.search(r"(\d+) postures: (\d+) identical to the last bit", " ".join(again.split()))
        assert match is not None, again
        assert match[1] == match[2]
        assert int(match[1]) > 20
        assert "e-stop" in " ".join((await done(inspect, folder)).split())
        assert list(folder.glob("**/*.png")), "no picture"
        await done(export, folder)
        (table,) = folder.glob("**/*.parquet")
        guard = parquet.read_table(table).column("guard").to_pylist()
        assert guard[-1] == ESTOP
        assert "track" in guard

    on_this_host(story)
