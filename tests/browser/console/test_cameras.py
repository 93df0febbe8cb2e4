"""Several cameras: one picture large, chosen by key, click or Enter; each grows old by itself."""

from __future__ import annotations

from typing import Any

import pytest
import simplejpeg

from tests.browser.console.browser import CHROMIUM
from tests.browser.console.fake import FakeConsole
from tests.browser.console.steps import state, until
from tests.browser.console.test_look import COVERED, OVERFLOWS

pytestmark = [
    pytest.mark.live,
    pytest.mark.skipif(CHROMIUM is None, reason="no chromium here: apt install chromium"),
]
FRAMES = """() => [...document.querySelectorAll(".camera")].map((e) => ({
  name: e.querySelector("canvas").getAttribute("aria-label"), large: e.classList.contains("large"),
  stale: e.classList.contains("stale"), none: e.classList.contains("none"),
  area: e.offsetWidth * e.offsetHeight, pixels: e.querySelector("canvas").toDataURL().length }))"""


def frames(page: Any) -> dict[str, dict[str, Any]]:
    """By the camera's name."""
    return {each["name"].split()[-1]: each for each in page.evaluate(FRAMES)}


def large(page: Any) -> str:
    found = [name for name, each in frames(page).items() if each["large"]]
    assert len(found) == 1, found
    return found[0]


def three(page: Any, fake: FakeConsole) -> None:
    """Pictures of three cameras; one is old after 3 s, so that a machine that is busy marks none."""
    fake.beside, fake.setup, fake.received = ("room", "hand"), {"stale_picture_s": 3.0}, []
    page.goto(fake.address)
    until(page, lambda: page.locator(".camera:not(.none, .stale)").count() == 3, 20.0)


def test_one_is_large_and_key_click_and_enter_choose_another(page: Any, fake: FakeConsole) -> None:
    three(page, fake)
    found = frames(page)
    assert list(found) == ["head", "hand", "room"], "the head first, then by name"
    assert large(page) == "head"
    assert all(found["head"]["area"] > 3 * found[other]["area"] for other in ("hand", "room"))
    page.keyboard.press("2")
    assert large(page) == "hand"
    assert list(frames(page)) == ["head", "hand", "room"], "a key means the same camera as before"
    page.locator(".camera").nth(2).click()
    assert large(page) == "room"
    page.locator("#camera-1").focus()
    page.keyboard.press("Enter")
    assert large(page) == "head"
    assert page.get_attribute("#camera-1", "aria-pressed") == "true"
    page.keyboard.press("9")
    assert large(page) == "head"
    until(page, lambda: len(fake.of_kind("look")) == 4)
    assert [each["camera"] for each in fake.of_kind("look")] == ["head", "hand", "room", "head"]
    assert fake.stop is None


def test_one_that_freezes_is_marked_alone_and_the_others_go_on(page: Any, fake: FakeConsole) -> None:
    three(page, fake)
    fake.frozen = ("head",)
    over, frame = page.locator(".camera.large.stale .over"), page.locator(".camera.large")
    until(page, lambda: over.count() == 1 and over.bounding_box() == frame.bounding_box())
    assert not any(frames(page)[name]["stale"] for name in ("hand", "room"))
    page.keyboard.press("3")
    fake.frozen = ("head", "hand")
    until(page, lambda: frames(page)["hand"]["stale"])
    until(page, lambda: page.locator(".camera.stale:not(.large) .over:visible").count() == 2)
    assert not frames(page)["room"]["stale"]
    assert "ms old" in page.inner_text("#home-age")
    page.keyboard.press("1")
    until(page, lambda: "s old" in page.inner_text("#home-age") and "ms" not in page.inner_text("#home-age"))


def test_what_is_looked_at_is_told_anew_to_a_console_that_restarted(page: Any, fake: FakeConsole) -> None:
    three(page, fake)
    page.keyboard.press("2")
    until(page, lambda: [each["camera"] for each in fake.of_kind("look")] == ["head", "hand"])
    fake.drop_sockets()
    until(page, lambda: [each["camera"] for each in fake.of_kind("look")] == ["head", "hand", "hand"])
    assert large(page) == "hand"


def test_a_page_without_pictures_asks_for_none(page: Any, fake: FakeConsole) -> None:
    page.goto(fake.address + "/engineer")
    until(page, lambda: {"kind": "look", "camera": None} in fake.received)


def test_a_digit_in_a_field_is_a_digit(page: Any, fake: FakeConsole) -> None:
    three(page, fake)
    fake.guard, fake.view = "estop", {}
    until(page, lambda: state(page) == "stopped")
    page.click("#reset")
    page.keyboard.type("23")
    assert page.input_value("#sheet-field") == "23"
    assert large(page) == "head"


@pytest.mark.parametrize("language", ["en", "zh"])
@pytest.mark.parametrize("size", [(1366, 768), (1920, 1080)])
def test_three_are_readable(page: Any, fake: FakeConsole, language: str, size: tuple[int, int]) -> None:
    axe = pytest.importorskip(
        "axe_playwright_python.sync_playwright", reason="the extra `browser` is not installed"
    )
    page.set_viewport_size({"width": size[0], "height": size[1]})
    three(page, fake)
    if language == "zh":
        page.keyboard.press("F7")
        until(page, lambda: "手" in page.inner_text("#camera-2"))
    fake.facts = {"lenses": {}}
    posture = {"position": fake.posture(1.0), "tube": [0.02] * len(fake.shape["joints"]), "ahead_ms": 100.0}
    fake.view = {"ahead": posture}
    until(page, lambda: page.inner_text(".large .lens-note") != "")
    assert page.evaluate(OVERFLOWS) == []
    fake.frozen = ("head", "hand")
    until(page, lambda: page.locator(".camera.stale").count() == 2)
    until(page, lambda: page.inner_text(".large .lens-note") == "")
    assert page.evaluate(OVERFLOWS) == []
    assert page.evaluate(COVERED) == 0
    found = axe.Axe().run(page).response["violations"]
    assert [each["id"] for each in found if each["impact"] in ("serious", "critical")] == []
    picture = simplejpeg.decode_jpeg(page.locator(".camera.stale:not(.large)").screenshot(type="jpeg"))
    assert picture.std() > 20.0, "stripes and words"
