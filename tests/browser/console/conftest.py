"""The page in a browser, opened at a console that plays a robot."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from tests.browser.console.browser import ARGUMENTS, CHROMIUM
from tests.browser.console.fake import FakeConsole

WATCH = """
const Plain = WebSocket;
window.WebSocket = class extends Plain {
  constructor(...given) {
    super(...given);
    this.addEventListener("message", () => { window.heard_ms = performance.now(); });
  }
};
const draw = WebGL2RenderingContext.prototype.drawElements;
let drawings = 0;
WebGL2RenderingContext.prototype.drawElements = function (...given) {
  // about 140 draw the robot as it was built, then 90 each posture: in the second one it has moved
  if (++drawings > 250) window.drawn_ms ??= performance.now();
  return draw.apply(this, given);
};
document.addEventListener("DOMContentLoaded", () => new MutationObserver(() => {
  if (document.body.dataset.state === "no_contact") window.black_ms ??= performance.now() - window.heard_ms;
}).observe(document.body, { attributeFilter: ["data-state"] }));
"""
"""Keeps, by the page's own clock, how long it took to say that it hears nothing, and when the robot moved."""
CUT = ("WebSocket connection to", "net::ERR_")
"""What the browser itself says where a test cuts the line."""
SMALL = {"width": 1366, "height": 768}


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    playwright_api = pytest.importorskip("playwright.sync_api", reason="the extra `browser` is not installed")
    with playwright_api.sync_playwright() as playwright:
        opened = playwright.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
        yield opened
        opened.close()


@pytest.fixture
def fake() -> Iterator[FakeConsole]:
    console = FakeConsole()
    yield console
    console.close()


@pytest.fixture
def page(browser: Any, fake: FakeConsole) -> Iterator[Any]:
    """The page in English. It says nothing on the browser's console, and asks no other place."""
    context = browser.new_context(viewport=SMALL, locale="en-GB", reduced_motion="reduce")
    context.add_init_script(WATCH)
    opened = context.new_page()
    said: list[str] = []
    asked: set[str] = set()
    opened.on("console", lambda message: said.append(message.text))
    opened.on("pageerror", lambda error: said.append(str(error)))
    opened.on("request", lambda request: asked.add(request.url.split("/")[2]))
    opened.goto(fake.address)
    yield opened
    context.close()
    assert asked == {fake.address.removeprefix("http://")}
    assert [line for line in said if not any(word in line for word in CUT)] == []
