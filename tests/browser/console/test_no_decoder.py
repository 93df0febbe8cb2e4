"""A browser without WebCodecs: the console makes JPEG of H.264 for its page, and for no other."""

from __future__ import annotations

import asyncio
from typing import Any

import numpy as np
import pytest

from common.clock import monotonic_ns
from common.wire.video import H264, VideoFrame
from slave.camera.h264 import H264Fitter
from tests.browser.console.browser import ARGUMENTS, CHROMIUM
from tests.browser.console.test_video import COUNT
from tests.deploy.console.robots import ROBOT, state
from tests.deploy.console.served import Served, served

playwright_api = pytest.importorskip("playwright.async_api", reason="the extra `browser` is not installed")
pytest.importorskip("av", reason="the extra `h264` is not installed")
pytestmark = [
    pytest.mark.live,
    pytest.mark.skipif(CHROMIUM is None, reason="no chromium here: apt install chromium"),
]
HIDDEN = "delete window.VideoDecoder;"
REFUSES = """
window.VideoDecoder = class {
  constructor({ error }) { this.error = error; this.state = "unconfigured"; }
  configure() {
    this.state = "configured";
    setTimeout(() => {
      this.state = "closed";
      this.error(new DOMException("no such profile", "NotSupportedError"));
    });
  }
  decode() {}
  close() { this.state = "closed"; }
};
"""
"""A browser that has WebCodecs and no H.264, as Chromium is built without its codecs."""
RED = """() => {
  const canvas = document.querySelector(".camera:not(.none) canvas");
  if (!canvas) return 0;
  const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
  let red = 0;
  for (let i = 0; i < data.length; i += 4) red += data[i] > 180 && data[i + 1] < 90;
  return red;
}"""


async def film(console: Served) -> None:
    """A red bar that moves over grey, until cancelled."""
    fitter, model, number, last = H264Fitter(12.0), console.models[ROBOT], 0, 0
    asked: list[str] = []
    console.hub.put_key = lambda robot, camera: asked.append(camera)
    while True:
        number += 1
        pixels = np.full((96, 128, 3), 60, np.uint8)
        left = 8 * (number % 12)
        pixels[:, left : left + 24] = (230, 40, 40)
        made = fitter.fit(pixels, 20_000, not last or bool(asked))
        asked.clear()
        now_ns = monotonic_ns()
        after = 0 if made.alone else last
        frame = VideoFrame(number, now_ns, now_ns, made.width, made.height, made.body, H264, after)
        last = number
        model.on_state(state(number, now_ns * 1e-9), now_ns, "link")
        if model.on_picture("head", frame, now_ns):
            console.hub.on_picture(model, "head")
        await asyncio.sleep(0.08)


@pytest.mark.parametrize("without", [HIDDEN, REFUSES], ids=["no WebCodecs", "no H.264"])
def test_the_picture_is_shown_and_its_page_alone_costs_it(without: str) -> None:
    async def story(console: Served) -> None:
        async with playwright_api.async_playwright() as playwright:
            browser = await playwright.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
            page: Any = await browser.new_page()
            await page.add_init_script(without)
            await page.goto(console.url)
            await page.evaluate(COUNT)
            async with asyncio.timeout(60.0):
                while await page.evaluate("shown.length") < 8 or await page.evaluate(RED) < 1000:
                    await page.wait_for_timeout(100)
            assert len(console.hub.jpeg) == 1
            await page.close()
            async with asyncio.timeout(20.0):
                while len(console.hub.jpeg):  # noqa: ASYNC110
                    await asyncio.sleep(0.05)
            await browser.close()

    async def told() -> None:
        async with served() as console, asyncio.TaskGroup() as tasks:
            running = [tasks.create_task(console.hub.show()), tasks.create_task(film(console))]
            try:
                await story(console)
            finally:
                for task in running:
                    task.cancel()

    asyncio.run(told())
