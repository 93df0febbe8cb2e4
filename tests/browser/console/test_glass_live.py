"""From scene to eye with a real suit, master, slave and console, in both codecs: measured by the pixels."""

from __future__ import annotations

import json
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import psutil
import pytest

from common.clock import monotonic_ns, to_ns
from deploy.harness.console import ConsoleChild
from deploy.harness.host import HostWatch
from deploy.harness.rig import Rig, open_rig
from deploy.harness.start import start_tracking
from tests.browser.console.browser import ARGUMENTS, CHROMIUM

if TYPE_CHECKING:
    from tests.conftest import OnThisHost

playwright_api = pytest.importorskip("playwright.async_api", reason="the extra `browser` is not installed")
pytestmark = [
    pytest.mark.live,
    pytest.mark.timeout(400),
    pytest.mark.skipif(CHROMIUM is None, reason="no chromium here: apt install chromium"),
]
KEEP = """
const Plain = WebSocket;
window.WebSocket = class extends Plain {
  constructor(...given) {
    super(...given);
    this.addEventListener("message", (event) => {
      if (typeof event.data !== "string") return;
      const message = JSON.parse(event.data);
      if (message.kind === "facts") window.facts = message;
      if (message.kind === "view") window.view = message;
    });
  }
};
"""
ENOUGH = 3


def raise_camera(rig: Rig) -> None:
    """From the lowest priority, to which other tests may leave nothing."""
    usage = rig.children["slave"]._usage
    assert usage is not None
    for child in usage.children():
        if "slave.camera" in " ".join(child.cmdline()):
            with suppress(psutil.AccessDenied):
                child.nice(0)


async def until(page: Any, holds: str, timeout_s: float) -> None:
    end_ns = monotonic_ns() + to_ns(timeout_s)
    while not await page.evaluate(holds):
        if monotonic_ns() > end_ns:
            seen = await page.evaluate(
                "({ facts: window.facts, video: window.view?.video, hidden: document.hidden })"
            )
            raise AssertionError(f"not within {timeout_s:g} s: {holds}; {json.dumps(seen)[:3000]}")
        await page.wait_for_timeout(50)


@pytest.mark.parametrize("codec", ["jpeg", "h264"])
def test_the_latency_from_scene_to_eye_is_measured_and_agrees_with_the_stamps(
    codec: str, on_this_host: OnThisHost, tmp_path: Path
) -> None:
    if codec == "h264":
        pytest.importorskip("av", reason="the extra `h264` is not installed")

    async def story(host: HostWatch) -> None:
        camera = ['camera.source="robot"', "camera.time_card=true", f'camera.codec="{codec}"']
        overrides = {
            "slave": [*camera, "guard.max_video_age_s=0.0"],
            "master": [f'tap.socket="{tmp_path / "master.sock"}"'],
        }
        async with open_rig(overrides=overrides) as rig, playwright_api.async_playwright() as playwright:
            await start_tracking(rig)
            state = rig.observer.state
            if state is not None and "no OpenGL" in state.faults.get("camera", ""):
                pytest.skip(state.faults["camera"])
            raise_camera(rig)
            console = ConsoleChild(rig)
            await console.start()
            browser = await playwright.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
            page = await browser.new_page(viewport={"width": 1366, "height": 768}, locale="en-GB")
            await page.add_init_script(KEEP)
            await page.goto(console.address)
            await until(page, f"(window.facts?.glass?.head?.count ?? 0) >= {ENOUGH}", 90.0)
            facts = await page.evaluate("window.facts")
            await page.screenshot(path=str(tmp_path / f"glass-{codec}.png"))
            words = await page.inner_text("#glass")
            figures = {**facts["glass"]["head"], "camera": facts["camera"], "ahead": facts["ahead"]}
            (tmp_path / f"glass-{codec}.json").write_text(json.dumps(figures))
            await browser.close()
            # stdout is shown where a person asks for it: pytest -s
            print(codec, words, json.dumps(figures))  # noqa: T201
            glass = facts["glass"]["head"]
            assert words.startswith("scene to eye ")
            assert glass["ms"] > -glass["bound_ms"]
            # the pixels say when the posture was read; so does the stamp, of a code's step
            assert abs(glass["stamp_off_ms"]) <= 0.11

    on_this_host(story)
