"""The list of reports: newest first, bounded, and walked beside the event loop."""

from __future__ import annotations

import asyncio
import os
import threading
from pathlib import Path
from typing import Any

import pytest

from deploy.console import reports
from deploy.console.reports import DEEPEST, ReportFolder
from tests.deploy.console.served import Served, served


def written(path: Path, changed_s: float) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("r")
    os.utime(path, (changed_s, changed_s))


def test_newest_first_down_to_a_depth(tmp_path: Path) -> None:
    deep = tmp_path.joinpath(*"abc"[: DEEPEST - 1])
    written(tmp_path / "old.html", 100.0)
    written(deep / "new.md", 200.0)
    written(deep / "d" / "deeper.html", 300.0)
    written(tmp_path / "part.png", 400.0)
    assert [one["name"] for one in ReportFolder(tmp_path).listed()] == ["a/b/c/new.md", "old.html"]


def test_a_folder_without_end_costs_a_bounded_walk(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(reports, "MOST_SEEN", 10)
    for number in range(30):
        written(tmp_path / f"{number}.html", float(number))
    assert len(ReportFolder(tmp_path).listed()) == 10
    assert "more than 10 files" in caplog.text


class SlowFolder:
    """A disk that takes as long as a test wants."""

    def __init__(self) -> None:
        self.goes_on = threading.Event()
        self.walks = 0

    def listed(self) -> list[dict[str, str]]:
        self.walks += 1
        assert self.goes_on.wait(30.0)
        return []


def test_a_slow_disk_keeps_no_other_request_waiting() -> None:
    async def story(console: Served) -> None:
        slow: Any = SlowFolder()
        console.hub.reports = slow

        async def ask() -> int:
            async with console.http.get(f"{console.url}/api/reports") as response:
                return response.status

        asked = [asyncio.create_task(ask()) for _ in range(5)]
        async with asyncio.timeout(20.0):
            for _ in range(3):
                async with console.http.get(f"{console.url}/api/clock") as response:
                    assert response.status == 200
            while not slow.walks:  # noqa: ASYNC110 - set by another thread
                await asyncio.sleep(0)
            slow.goes_on.set()
            assert await asyncio.gather(*asked) == [200] * 5

    async def told() -> None:
        async with served() as console:
            await story(console)

    asyncio.run(told())
