"""Over the picture: where the robot is by now, by a camera whose lens is known, and never over an old one."""

from __future__ import annotations

from typing import Any

import pytest

from common.metrics.tree import to_tree
from common.skeleton import load_skeleton
from slave.camera.lens import eye
from tests.browser.console.browser import CHROMIUM
from tests.browser.console.fake import FakeConsole
from tests.browser.console.steps import until

pytestmark = [
    pytest.mark.live,
    pytest.mark.skipif(CHROMIUM is None, reason="no chromium here: apt install chromium"),
]
DRAWN = """(() => {
  const canvas = document.querySelector(".camera .will");
  if (!canvas || canvas.width < 2 || !canvas.checkVisibility()) return 0;
  const copy = new OffscreenCanvas(canvas.width, canvas.height);
  const context = copy.getContext("2d", { willReadFrequently: true });
  context.drawImage(canvas, 0, 0);
  const { data } = context.getImageData(0, 0, copy.width, copy.height);
  let n = 0;
  for (let i = 3; i < data.length; i += 4) n += data[i] > 0;
  return n / (canvas.width * canvas.height);
})()"""
"""Which share of the picture is covered."""


def foretold(fake: FakeConsole) -> dict[str, Any]:
    joints = len(fake.shape["joints"])
    return {"position": fake.posture(1.0), "tube": [0.02] * joints, "ahead_ms": 100.0}


def test_it_is_drawn_over_a_camera_that_is_known_and_goes_with_what_tells_it(
    page: Any, fake: FakeConsole
) -> None:
    lens = eye(load_skeleton("nursing"), "head", 320, 240)
    assert lens is not None
    fake.view = {"ahead": foretold(fake)}
    until(page, lambda: bool(page.evaluate("document.querySelector('.camera:not(.none) canvas')")))
    assert page.evaluate(DRAWN) == 0.0, "no lens is known"
    fake.facts = {"lenses": {"head": to_tree(lens)}}
    until(page, lambda: 0.01 < page.evaluate(DRAWN) < 0.9)
    fake.view = {"ahead": None}
    until(page, lambda: page.evaluate(DRAWN) == 0.0)
    fake.view = {"ahead": foretold(fake)}
    until(page, lambda: page.evaluate(DRAWN) > 0.01)
    # an encoder that is not valid: nobody knows where the head, and so the camera, stands
    fake.view = {"ahead": foretold(fake), "encoder": [None, *fake.posture(0.0)[1:]]}
    until(page, lambda: page.evaluate(DRAWN) == 0.0)
    fake.view = {"ahead": foretold(fake)}
    until(page, lambda: page.evaluate(DRAWN) > 0.01)
    fake.pictures = False
    until(page, lambda: bool(page.evaluate("document.querySelector('.camera.stale')")))
    until(page, lambda: page.evaluate(DRAWN) == 0.0)


def test_one_of_another_camera_is_not_drawn_over_this_one(page: Any, fake: FakeConsole) -> None:
    lens = eye(load_skeleton("nursing"), "head", 320, 240)
    assert lens is not None
    fake.view, fake.facts = {"ahead": foretold(fake)}, {"lenses": {"room": to_tree(lens)}}
    until(page, lambda: bool(page.evaluate("document.querySelector('.camera:not(.none) canvas')")))
    page.wait_for_timeout(1500)
    assert page.evaluate(DRAWN) == 0.0
