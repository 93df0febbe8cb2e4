"""How the page looks: nothing overflows or covers the stop, states differ without colour, axe is content."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pytest
import simplejpeg

from tests.browser.console.browser import CHROMIUM
from tests.browser.console.fake import LED, STUDY, FakeConsole
from tests.browser.console.steps import state, until

pytestmark = [
    pytest.mark.live,
    pytest.mark.skipif(CHROMIUM is None, reason="no chromium here: apt install chromium"),
]
OVERFLOWS = """() => {
  const cut = ["why", "told"];  // words of a robot may be of any length: these end in an ellipsis
  const found = [];
  const shown = (e) => e.checkVisibility({ visibilityProperty: true }) && !e.closest(".hidden, #late-minute");
  for (const e of document.querySelectorAll("body *")) {
    const text = [...e.childNodes].some((n) => n.nodeType === 3 && n.textContent.trim());
    if (!text || !shown(e) || e.namespaceURI.endsWith("svg") || e.tagName === "OPTION") continue;
    const box = e.getBoundingClientRect();
    const name = `${e.id || e.tagName} "${e.textContent.trim().slice(0, 40)}"`;
    if (box.right > innerWidth + 1 || box.bottom > innerHeight + 1 || box.left < -1) {
      if (!e.closest("#events, #joints, #node-table, #counters")) found.push(`${name} leaves the window`);
    }
    const wide = e.clientWidth && e.scrollWidth > e.clientWidth + 1;
    if (wide && !cut.includes(e.id)) found.push(`${name} is too wide`);
    for (let a = e.parentElement; a && a !== document.body; a = a.parentElement) {
      const style = getComputedStyle(a);
      if (/auto|scroll/.test(style.overflowY)) break;
      const edge = a.getBoundingClientRect();
      if (style.overflowX === "hidden" && (box.right > edge.right + 1 || box.bottom > edge.bottom + 1)) {
        found.push(`${name} is cut by ${a.id || a.tagName}`);
      }
    }
  }
  const panels = "header, footer, main, section, section div, section ol, section ul";
  for (const e of document.querySelectorAll(panels)) {
    const more = e.scrollWidth - e.clientWidth;
    if (!shown(e) || !e.clientWidth || more <= 1) continue;
    found.push(`the panel ${e.id || e.className || e.tagName} is ${more} px too wide`);
  }
  return found;
}"""
COVERED = """() => {
  const box = document.getElementById("stop").getBoundingClientRect();
  const places = [[0.5, 0.5], [0.03, 0.1], [0.97, 0.1], [0.03, 0.9], [0.97, 0.9]];
  return places.filter(([x, y]) => !document.elementFromPoint(
    box.left + x * box.width, box.top + y * box.height)?.closest("#stop")).length;
}"""
SCENES: dict[str, dict[str, Any]] = {
    "follows": {"guard": "track"},
    "holds": {"guard": "hold"},
    "aligns": {"guard": "align"},
    "stopped": {
        "guard": "estop",
        "view": {
            "stop": {"id": 1, "by": "", "asked_s": 0.0, "robot_s": 0.02, "stands_s": 12.31, "failed": ""}
        },
    },
    "starting": {"guard": "boot"},
    "clutch": {"guard": "clutch", "view": {"situation": "repositions"}},
    "other": {
        "guard": "hold",
        "view": {"situation": "other_operator", "lease": "other", "operator": "nurse-22"},
    },
    "no_robot": {"guard": "track", "view": {"heard": "none", "situation": "silent"}},
}


def show(page: Any, fake: FakeConsole, wanted: str) -> None:
    fake.guard, fake.view = SCENES[wanted]["guard"], SCENES[wanted].get("view", {})
    until(page, lambda: state(page) == wanted)


@pytest.mark.parametrize("path", ["/", "/engineer", "/study", "/calibrate"])
@pytest.mark.parametrize("language", ["en", "zh"])
@pytest.mark.parametrize("size", [(1366, 768), (1920, 1080)])
def test_nothing_overflows_and_nothing_covers_the_stop(
    page: Any, fake: FakeConsole, path: str, language: str, size: tuple[int, int]
) -> None:
    page.set_viewport_size({"width": size[0], "height": size[1]})
    fake.facts = {"study": STUDY, "effort_nm": [-12.3] * 25, "drives": {"temperature_c": [41.0] * 25}}
    fake.calibration = LED
    page.goto(fake.address + path)
    until(page, lambda: state(page) == "follows")
    if language == "zh":
        page.keyboard.press("F7")
    places = set()
    for wanted in SCENES:
        show(page, fake, wanted)
        assert page.evaluate(OVERFLOWS) == [], wanted
        assert page.evaluate(COVERED) == 0, wanted
        places.add(str(page.locator("#stop").bounding_box()))
    show(page, fake, "stopped")
    if path == "/":
        page.click("#show-joints")
        until(page, lambda: page.is_visible("#joints"))
        assert page.evaluate(OVERFLOWS) == []
        page.click("#show-joints")
    page.click("#reset")
    assert page.evaluate(COVERED) == 0
    fake.silent = True
    until(page, lambda: state(page) == "no_contact")
    assert page.evaluate(OVERFLOWS) == []
    places.add(str(page.locator("#stop").bounding_box()))
    assert len(places) == 1, "the stop stands in one place"


def test_the_stop_is_the_largest_thing_to_press(page: Any, fake: FakeConsole) -> None:
    until(page, lambda: state(page) == "follows")
    areas = page.evaluate(
        "Object.fromEntries([...document.querySelectorAll('button, select, a')].map((e) => "
        "[e.id, e.offsetWidth * e.offsetHeight]))"
    )
    stop = areas.pop("stop")
    assert stop > 8 * max(areas.values())


def test_states_differ_without_colour_in_word_and_in_figure(page: Any, fake: FakeConsole) -> None:
    until(page, lambda: state(page) == "follows")
    masks, words = {}, {}
    for wanted in [*SCENES, "no_contact"]:
        if wanted == "no_contact":
            fake.silent = True
            until(page, lambda: state(page) == "no_contact")
        else:
            show(page, fake, wanted)
        picture = simplejpeg.decode_jpeg(page.locator("#shape").screenshot(type="jpeg"), "GRAY")[..., 0]
        masks[wanted] = np.abs(picture.astype(float) - picture[2, 2]) > 40.0
        words[wanted] = page.inner_text("#word")
    assert len(set(words.values())) == len(words)
    for one, other in itertools.combinations(masks, 2):
        either = np.count_nonzero(masks[one] | masks[other])
        both = np.count_nonzero(masks[one] & masks[other])
        assert either > 200, f"{one} and {other} have no figure"
        assert both / either < 0.8, f"{one} and {other} look alike"


@pytest.mark.parametrize("path", ["/", "/engineer", "/study", "/calibrate"])
@pytest.mark.parametrize("wanted", ["follows", "stopped", "no_robot"])
def test_axe_finds_nothing_serious(page: Any, fake: FakeConsole, path: str, wanted: str) -> None:
    axe = pytest.importorskip(
        "axe_playwright_python.sync_playwright", reason="the extra `browser` is not installed"
    )
    fake.facts = {"study": STUDY}
    page.goto(fake.address + path)
    until(page, lambda: state(page) == "follows")
    show(page, fake, wanted)
    found = axe.Axe().run(page).response["violations"]
    serious = [
        (each["id"], [node["target"] for node in each["nodes"]], each["nodes"][0]["failureSummary"])
        for each in found
        if each["impact"] in ("serious", "critical")
    ]
    assert serious == []


def test_everything_is_reached_by_the_keyboard(page: Any, fake: FakeConsole) -> None:
    until(page, lambda: state(page) == "follows")
    fake.stop = None
    wanted = set(
        page.evaluate(
            "[...document.querySelectorAll('button, select, a, input')]"
            ".filter((e) => e.checkVisibility() && !e.disabled).map((e) => e.id)"
        )
    )
    reached = set()
    for _ in range(3 * len(wanted)):
        page.keyboard.press("Tab")
        reached.add(page.evaluate("document.activeElement.id"))
    assert wanted <= reached
