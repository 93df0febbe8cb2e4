"""The page of calibration in a browser: it leads by keys, sounds the countdown, shows each result."""

from __future__ import annotations

import copy
from typing import Any

import pytest

from tests.browser.console.browser import CHROMIUM
from tests.browser.console.fake import LED, FakeConsole
from tests.browser.console.steps import state, until

pytestmark = [
    pytest.mark.live,
    pytest.mark.skipif(CHROMIUM is None, reason="no chromium here: apt install chromium"),
]
SOUNDS = """() => {
  window.tones = [];
  const start = OscillatorNode.prototype.start;
  OscillatorNode.prototype.start = function (...given) {
    window.tones.push(this.frequency.value);
    return start.apply(this, given);
  };
}"""


def led(**pose: Any) -> dict[str, Any]:
    told = copy.deepcopy(LED)
    told["view"]["zero_pose"] |= pose
    return told


def asked(fake: FakeConsole) -> list[dict[str, Any]]:
    return [body for path, body in fake.posted if path == "calibrate"]


@pytest.fixture
def suit(page: Any, fake: FakeConsole) -> Any:
    fake.guard, fake.reason = "hold", "disengaged"
    page.goto(f"{fake.address}/calibrate")
    until(page, lambda: state(page) == "holds")
    page.evaluate(SOUNDS)
    until(page, lambda: page.is_enabled("#lead-begin"))
    return page


def test_a_zero_pose_is_led_by_the_keyboard_alone(suit: Any, fake: FakeConsole) -> None:
    suit.uncheck("#lead-what [value=imu]")
    suit.focus("#lead-begin")
    suit.keyboard.press("Enter")
    until(suit, lambda: asked(fake) == [{"do": "begin", "what": ["mag", "align"]}])
    fake.calibration = led()
    until(suit, lambda: suit.inner_text("#lead-title") == "Stand in the zero pose")
    assert "palms facing the thighs" in suit.inner_text("#lead-todo")
    assert "Keep still for 3 s" in suit.inner_text("#lead-todo")
    assert suit.inner_text("#lead-word-word") == "I am ready: count down"
    suit.keyboard.press("F8")
    until(suit, lambda: asked(fake)[-1] == {"do": "word"})
    for left in (2.6, 2.2, 1.6, 0.4):
        fake.calibration = led(waits=False, countdown_s=left)
        until(suit, lambda left=left: suit.inner_text("#lead-count") == str(int(left) + 1))  # type: ignore[misc]
    assert suit.evaluate("tones") == [660, 660, 660]
    fake.calibration = led(waits=False, held_s=0.25)
    until(suit, lambda: suit.inner_text("#lead-count") == "0.3 / 3 s")
    assert suit.inner_text("#lead-state") == "1 sensors move: keep still"
    done = led()
    done["view"] |= {"step": "move_joints", "zero_pose": None}
    fake.calibration = done
    until(suit, lambda: suit.inner_text("#lead-title") == "Move every joint")
    assert suit.evaluate("tones") == [660, 660, 660, 990, 1320, 1320]


def test_each_sensor_is_shown_on_the_figure_and_in_words(suit: Any, fake: FakeConsole) -> None:
    fake.calibration = led()
    until(suit, lambda: suit.locator("#led-nodes li").count() == 3)
    rows = suit.locator("#led-nodes li").all_inner_texts()
    assert [row.split("\n")[0] for row in rows] == ["left forearm", "right hand", "head"]
    assert "silent: look at its plug" in rows[0]
    assert suit.locator("#led-figure text").all_text_contents() == ["✕", "!"]
    suit.keyboard.press("F7")
    until(suit, lambda: suit.inner_text("#lead-title") == "以零位姿势站立")
    assert "无信号：请检查插头" in suit.locator("#led-nodes li").all_inner_texts()[0]


def test_what_is_not_complete_is_left_only_by_a_second_press(suit: Any, fake: FakeConsole) -> None:
    told = led()
    told["view"] |= {"step": "tumble", "zero_pose": None}
    fake.calibration = told
    until(suit, lambda: suit.inner_text("#lead-word-word") == "Go on with what there is")
    suit.keyboard.press("F8")
    until(suit, lambda: "Press again" in suit.inner_text("#lead-word-word"))
    assert asked(fake) == []
    suit.keyboard.press("F8")
    until(suit, lambda: asked(fake) == [{"do": "word"}])


def test_the_result_says_what_was_written_what_not_and_what_to_do(suit: Any, fake: FakeConsole) -> None:
    outcome = {
        "nodes": {"head": {"imu": "", "mag": ""}, "left_forearm": {"imu": "fewer than 12 attitudes"}},
        "whole": ["align: the zero pose was not held"],
        "folder": "/etc/tandem/calibration", "to_name": ["head"],
    }  # fmt: skip
    fake.calibration = {"under_way": False, "outcome": outcome}
    until(suit, lambda: suit.inner_text("#lead-title") == "Result")
    assert "/etc/tandem/calibration" in suit.inner_text("#lead-todo")
    assert suit.inner_text("#lead-todo").endswith("restart the master: head")
    rows = suit.locator("#led-nodes li").all_inner_texts()
    assert "accelerometer and gyroscope: fewer than 12 attitudes" in rows[0]
    assert "written: accelerometer and gyroscope, magnetometer" in rows[1]
    assert suit.locator("#led-figure text").all_text_contents() == ["■"]
    assert suit.inner_text("#lead-outcome") == "align: the zero pose was not held"


def test_a_page_that_only_looks_cannot_begin_and_space_still_stops(suit: Any, fake: FakeConsole) -> None:
    fake.may = {**fake.may, "act": False}
    suit.reload()
    until(suit, lambda: state(suit) == "holds")
    assert suit.is_disabled("#lead-begin")
    suit.keyboard.press(" ")
    until(suit, lambda: state(suit) == "stopped")
