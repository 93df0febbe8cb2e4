"""The trial's report in a real browser: it says nothing on the console and asks nobody for anything."""

from __future__ import annotations

import json
import shutil
import struct
import subprocess
from pathlib import Path

import pytest

from deploy.experiments.trial.cell.folder import Folder
from deploy.experiments.trial.report.write import HTML, write
from tests.deploy.experiments.trial.made_up import PLAN, cells

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
pytestmark = [
    pytest.mark.live,
    pytest.mark.skipif(CHROMIUM is None, reason="no chromium here: apt install chromium"),
]
FLAGS = (
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
    # whatever the browser itself or a page asks for, no name has an address
    "--host-resolver-rules=MAP * ~NOTFOUND", "--enable-logging=stderr", "--window-size=1280,1600",
)  # fmt: skip
OWN = (None, "not an origin")
"""Who asks where the browser asks for itself."""


def opened(page: Path, folder: Path) -> tuple[list[str], set[str], Path]:
    """What it says on the console, what it asks for, and a picture of it."""
    picture, log = folder / "page.png", folder / "net.json"
    command = [str(CHROMIUM), *FLAGS, f"--user-data-dir={folder / 'profile'}", f"--log-net-log={log}",
               f"--screenshot={picture}", page.as_uri()]  # fmt: skip
    said = subprocess.run(command, capture_output=True, text=True, timeout=90, check=True).stderr
    events = [event.get("params", {}) for event in json.loads(log.read_text("utf-8"))["events"]]
    asked = {params["url"] for params in events if "url" in params and params.get("initiator") not in OWN}
    return [line for line in said.splitlines() if ":CONSOLE:" in line], asked, picture


def size(png: Path) -> tuple[int, int]:
    width, height = struct.unpack(">II", png.read_bytes()[16:24])
    return width, height


def test_the_report_opens_offline_and_says_nothing(tmp_path: Path) -> None:
    folder = Folder(tmp_path / "report")
    folder.begin(PLAN)
    for one in cells():
        folder.keep(one)
    write(folder)
    console, asked, picture = opened(folder.path / HTML, tmp_path)
    assert console == []
    assert asked == set()
    assert size(picture) == (1280, 1600)
    assert picture.stat().st_size > 50_000, "an empty page is a few kilobytes"


def test_a_page_that_asks_and_complains_would_be_noticed(tmp_path: Path) -> None:
    page = tmp_path / "bad.html"
    page.write_text('<img src="http://example.invalid/x.png"><script>console.error("no")</script>', "utf-8")
    console, asked, _ = opened(page, tmp_path)
    assert any('"no"' in line for line in console)
    assert asked == {"http://example.invalid/x.png"}
