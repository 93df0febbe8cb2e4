"""H.264 in a real browser: shown picture by picture, and never a wrong one after a loss."""

from __future__ import annotations

from typing import Any

import pytest

from slave.camera.h264 import H264Fitter
from slave.camera.jpeg import Pixels
from tests.browser.console.browser import CHROMIUM
from tests.browser.console.fake import FakeConsole
from tests.browser.console.steps import until

av = pytest.importorskip("av", reason="the extra `h264` is not installed")
pytestmark = [
    pytest.mark.live,
    pytest.mark.skipif(CHROMIUM is None, reason="no chromium here: apt install chromium"),
]
CAN = "VideoDecoder.isConfigSupported({ codec: 'avc1.42C00D' }).then((found) => found.supported)"
LOOK = "document.querySelector('.camera:not(.none) canvas')?.toDataURL() ?? ''"
COUNT = """() => {
window.shown = [];
const draw = CanvasRenderingContext2D.prototype.drawImage;
CanvasRenderingContext2D.prototype.drawImage = function (...given) {
  if (this.canvas.closest(".camera")) window.shown.push(performance.now());
  return draw.apply(this, given);
};
}"""


@pytest.fixture
def stream(page: Any, fake: FakeConsole) -> list[bool]:
    """Whether each picture that was encoded stands alone."""
    if not page.evaluate(f"typeof VideoDecoder !== 'undefined' && {CAN}"):
        pytest.skip("this chromium has no H.264 decoder")
    alone: list[bool] = []
    fitter = H264Fitter(12.0)

    def encode(pixels: Pixels, key: bool) -> tuple[bytes, bool]:
        made = fitter.fit(pixels, 20_000, key)
        alone.append(made.alone)
        return made.body, made.alone

    fake.h264 = encode
    page.evaluate(COUNT)
    return alone


def test_pictures_move(page: Any, fake: FakeConsole, stream: list[bool]) -> None:
    until(page, lambda: bool(page.evaluate(LOOK)), 30.0)
    first = page.evaluate(LOOK)
    until(page, lambda: page.evaluate(LOOK) != first, 30.0)


def test_after_a_loss_nothing_is_drawn_until_a_picture_that_stands_alone(
    page: Any, fake: FakeConsole, stream: list[bool]
) -> None:
    until(page, lambda: page.evaluate("shown.length") > 5, 30.0)
    fake._wants_key = False
    asked = len(fake.of_kind("keyframe"))
    begun = len(stream)
    fake.loses = 1
    until(page, lambda: len(fake.of_kind("keyframe")) > asked, 30.0)
    until(page, lambda: any(stream[begun:]), 30.0)
    after = page.evaluate("shown.length")
    until(page, lambda: page.evaluate("shown.length") > after + 3, 30.0)


def test_what_is_shown_is_the_picture_of_its_header(page: Any, fake: FakeConsole, stream: list[bool]) -> None:
    """The time in the pixels: it never goes back, and the decoder holds no picture back."""
    fake.coded = True
    until(page, lambda: len(fake.of_kind("shown")) >= 4, 60.0)
    counts = [max(message["counts"]) for message in fake.of_kind("shown")]
    assert counts == sorted(counts)
