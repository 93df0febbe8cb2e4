"""A report in a real browser, served by the console itself: with its pictures, and without its scripts."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest

from common.clock import monotonic_ns
from deploy.console.reports import ReportFolder
from deploy.console.session import PageRole
from tests.browser.console.browser import ARGUMENTS, CHROMIUM
from tests.deploy.console.served import NURSE, served

playwright_api = pytest.importorskip("playwright.async_api", reason="the extra `browser` is not installed")
pytestmark = [
    pytest.mark.live,
    pytest.mark.skipif(CHROMIUM is None, reason="no chromium here: apt install chromium"),
]
LOG_IN = """(token) => fetch("/api/login", {
  method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify({ token }),
}).then((answer) => answer.status)"""


@pytest.mark.parametrize("stranger", [PageRole.VIEWER, PageRole.NOBODY])
def test_a_report_shows_its_pictures_and_runs_no_script(tmp_path: Path, stranger: PageRole) -> None:
    """Also where its parts are served to those alone who have logged in."""
    (tmp_path / "p.svg").write_text('<svg xmlns="http://www.w3.org/2000/svg" width="9" height="9"/>')
    (tmp_path / "r.html").write_text('<title>r</title><img src="p.svg"><script>document.title = 1</script>')

    async def story() -> tuple[int, str]:
        async with served(stranger) as console, playwright_api.async_playwright() as playwright:
            console.hub.reports = ReportFolder(tmp_path)
            browser = await playwright.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
            page = await browser.new_page()
            await page.goto(f"{console.url}/code")
            assert await page.evaluate(LOG_IN, console.access.issue(NURSE, monotonic_ns())) == 200
            await page.goto(f"{console.url}/reports/r.html")
            seen = await page.evaluate("document.images[0].naturalWidth"), await page.title()
            await browser.close()
        return seen

    assert asyncio.run(story()) == (9, "r")
