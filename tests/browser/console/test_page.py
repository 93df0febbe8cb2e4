"""The console's page in a real browser, against a console that plays a robot."""

from __future__ import annotations

import math
import re
import time
from typing import Any

import pytest

from tests.browser.console.browser import CHROMIUM
from tests.browser.console.fake import STUDY, FakeConsole
from tests.browser.console.steps import state, until

pytestmark = [
    pytest.mark.live,
    pytest.mark.skipif(CHROMIUM is None, reason="no chromium here: apt install chromium"),
]


def engages(fake: FakeConsole) -> list[dict[str, Any]]:
    """What the page asked of robots that shall move."""
    return [body for what, body in fake.posted if what == "act" and body.get("act") == "engage"]


def test_it_moves_within_two_seconds_of_opening(page: Any, fake: FakeConsole) -> None:
    took_ms: list[float] = []
    while (
        len(took_ms) < 6 and min(took_ms, default=9e9) >= 2000.0
    ):  # another process may have taken the cores
        page.goto(f"{fake.address}/")
        until(page, lambda: page.evaluate("Boolean(window.drawn_ms)"))
        took_ms.append(page.evaluate("window.drawn_ms"))
    assert min(took_ms) < 2000.0, took_ms


def test_it_loads_and_shows_the_robot_move(page: Any, fake: FakeConsole) -> None:
    page.wait_for_selector("#scene canvas")
    until(page, lambda: state(page) == "follows")
    look = "document.querySelector('#scene canvas').toDataURL()"
    first = page.evaluate(look)
    until(page, lambda: page.evaluate(look) != first)


def test_the_joint_table_equals_the_encoders(page: Any, fake: FakeConsole) -> None:
    page.wait_for_selector("#scene canvas")
    page.click("#show-joints")
    fake.still = True
    cells = "document.querySelectorAll('#joints tr[data-joint] td:nth-child(2)')"
    read = f"[...{cells}].map((cell) => Number(cell.textContent))"
    wanted = [math.degrees(angle) for angle in fake.posture(-0.06)]
    until(page, lambda: page.evaluate(read) == pytest.approx(wanted, abs=0.0501))


@pytest.mark.parametrize("way", ["Escape", " ", "pointer"])
def test_stop_is_sent_both_ways_and_the_three_lights_come(page: Any, fake: FakeConsole, way: str) -> None:
    until(page, lambda: state(page) == "follows")
    if way == "pointer":
        page.hover("#stop")
        page.mouse.down()  # acts on the press, not on the release
    else:
        page.keyboard.press(way)
    until(page, lambda: bool(fake.of_kind("stop")) and ("stop", {"robot": "robot-1"}) in fake.posted)
    until(page, lambda: state(page) == "stopped")
    until(page, lambda: page.locator("#lights li.on").count() == 3)


def test_stop_by_space_even_where_another_button_has_the_focus(page: Any, fake: FakeConsole) -> None:
    until(page, lambda: state(page) == "follows")
    page.focus("#language")
    page.keyboard.press(" ")
    until(page, lambda: bool(fake.of_kind("stop")))
    assert page.evaluate("document.documentElement.lang") == "en"


def test_without_messages_it_is_black_and_says_that_a_stop_was_not_sent(page: Any, fake: FakeConsole) -> None:
    until(page, lambda: state(page) == "follows")
    fake.silent = True
    until(page, lambda: state(page) == "no_contact")
    # half a second is tested at its boundary in test_state.py; here the browser itself may be late
    assert 500.0 < page.evaluate("black_ms") < 3000.0
    assert not page.is_visible("#home h2")
    assert "dead" in page.get_attribute("#stop", "class")
    assert "switch at the robot" in page.inner_text("#stop-note")
    page.context.set_offline(True)
    fake.drop_sockets()
    page.keyboard.press("Escape")
    until(page, lambda: "NOT SENT" in page.inner_text("#stop-note"))
    page.context.set_offline(False)
    fake.silent = False
    # the stop is still wanted: it is sent as soon as it can be
    until(page, lambda: ("stop", {"robot": "robot-1"}) in fake.posted)
    until(page, lambda: state(page) == "stopped")


def test_it_comes_back_when_the_socket_was_cut(page: Any, fake: FakeConsole) -> None:
    until(page, lambda: state(page) == "follows")
    fake.drop_sockets()
    fake.guard, fake.reason = "hold", "nobody has engaged"
    until(page, lambda: state(page) == "holds")


def test_a_second_page_sees_the_same(page: Any, fake: FakeConsole) -> None:
    second = page.context.new_page()
    second.goto(fake.address)
    until(second, lambda: state(second) == "follows")
    assert second.inner_text("#why") == page.inner_text("#why")
    second.keyboard.press("Escape")
    until(page, lambda: state(page) == "stopped")


def test_engage_wants_a_second_of_holding(page: Any, fake: FakeConsole) -> None:
    fake.guard, fake.reason = "hold", "nobody has engaged"
    until(page, lambda: state(page) == "holds")
    page.keyboard.down("F2")
    page.wait_for_timeout(300)
    page.keyboard.up("F2")
    page.wait_for_timeout(1000)
    assert not engages(fake)
    page.keyboard.down("F2")
    until(page, lambda: engages(fake) == [{"act": "engage", "robot": "robot-1", "together": False}])
    page.keyboard.up("F2")
    until(page, lambda: state(page) == "aligns")


def test_several_robots_move_together_only_by_shift(page: Any, fake: FakeConsole) -> None:
    fake.guard, fake.reason = "hold", "nobody has engaged"
    until(page, lambda: state(page) == "holds")
    page.keyboard.down("Shift")
    page.keyboard.down("F2")
    until(page, lambda: engages(fake) == [{"act": "engage", "robot": "robot-1", "together": True}])
    page.keyboard.up("F2")
    page.keyboard.up("Shift")


def test_disengage_mark_and_language_by_key(page: Any, fake: FakeConsole) -> None:
    until(page, lambda: state(page) == "follows")
    page.keyboard.press("F3")
    page.keyboard.press("F4")
    until(page, lambda: {body.get("act") for _, body in fake.posted} >= {"disengage", "mark"})
    page.keyboard.press("F7")
    until(page, lambda: page.inner_text("#word") == "跟随中")
    assert page.evaluate("document.documentElement.lang") == "zh-Hans"


def test_the_deadman_beats_while_its_key_is_held(page: Any, fake: FakeConsole) -> None:
    until(page, lambda: state(page) == "follows" and page.is_visible("#hold"))
    page.keyboard.down("F9")
    until(page, lambda: len(fake.of_kind("held")) >= 8)
    page.keyboard.up("F9")
    until(page, lambda: fake.of_kind("held")[-1]["down"] is False)
    beats = fake.of_kind("held")
    page.wait_for_timeout(300)
    assert len(fake.of_kind("held")) == len(beats)
    assert all(beat["n"] > 0 for beat in beats if beat["down"])


def test_the_deadmans_key_is_let_go_also_under_another_name(page: Any, fake: FakeConsole) -> None:
    fake.setup = {"deadman_key": "h"}
    page.reload()
    until(page, lambda: state(page) == "follows" and page.is_visible("#hold"))
    page.keyboard.down("h")
    until(page, lambda: len([beat for beat in fake.of_kind("held") if beat["down"]]) >= 2)
    page.evaluate("window.dispatchEvent(new KeyboardEvent('keyup', { key: 'H', code: 'KeyH' }))")
    until(page, lambda: fake.of_kind("held")[-1]["down"] is False)


def test_a_page_that_comes_back_holds_nothing(page: Any, fake: FakeConsole) -> None:
    until(page, lambda: state(page) == "follows" and page.is_visible("#hold"))
    page.keyboard.down("F9")
    until(page, lambda: len([beat for beat in fake.of_kind("held") if beat["down"]]) >= 2)
    fake.drop_sockets()
    until(page, lambda: fake.of_kind("held")[-1]["down"] is False)
    page.wait_for_timeout(300)
    assert fake.of_kind("held")[-1]["down"] is False, "the key is still down"
    assert "down" not in (page.get_attribute("#hold", "class") or "")


def test_nobody_engages_what_the_page_does_not_see(page: Any, fake: FakeConsole) -> None:
    fake.guard, fake.reason = "hold", "nobody has engaged"
    until(page, lambda: state(page) == "holds")
    fake.mute = True
    until(page, lambda: state(page) == "no_contact")
    page.keyboard.down("F2")
    until(page, lambda: "Not sent" in page.inner_text("#told"))
    page.keyboard.up("F2")
    assert not engages(fake)


def test_a_page_that_is_told_nothing_stops_the_robot_that_its_address_names(
    page: Any, fake: FakeConsole
) -> None:
    fake.mute = True
    page.goto(f"{fake.address}/?robot=robot-2")
    until(page, lambda: state(page) == "no_contact")
    page.keyboard.press("Escape")
    until(page, lambda: ("stop", {"robot": "robot-2"}) in fake.posted)


def test_the_stop_says_that_it_is_not_ready_where_the_page_is_not_whole(page: Any, fake: FakeConsole) -> None:
    page.route("**/page/facts.js", lambda route: route.abort())
    page.goto(fake.address)
    until(page, lambda: "NOT READY" in page.inner_text("#stop-note"))
    assert "dead" in page.get_attribute("#stop", "class")


def test_who_may_not_look_reads_that_his_stop_failed(page: Any, fake: FakeConsole) -> None:
    fake.role, fake.may = "nobody", {"stop": True, "act": False, "reset": False, "hold": False}
    lights = {"since_s": 0.0, "asked_s": 0.0, "robot_s": None, "stands_s": None}
    fake.told_stop = {**lights, "failed": "no answer"}
    page.reload()
    until(page, lambda: state(page) == "locked")
    page.keyboard.press("Escape")
    until(page, lambda: "NOT STOPPED: no answer" in page.inner_text("#stop-note"))


def test_the_deadman_is_let_go_when_the_page_loses_the_focus(page: Any, fake: FakeConsole) -> None:
    until(page, lambda: state(page) == "follows" and page.is_visible("#hold"))
    page.keyboard.down("F9")
    until(page, lambda: len(fake.of_kind("held")) >= 2)
    page.evaluate("window.dispatchEvent(new Event('blur'))")
    until(page, lambda: fake.of_kind("held")[-1]["down"] is False)


def test_who_only_looks_cannot_engage_but_can_stop(page: Any, fake: FakeConsole) -> None:
    fake.may = {"stop": True, "act": False, "reset": False, "hold": False}
    fake.drop_sockets()
    until(page, lambda: "looking only" in page.inner_text("#badges"))
    assert page.is_disabled("#engage")
    page.keyboard.down("F2")
    page.wait_for_timeout(1200)
    page.keyboard.press("F3")
    assert fake.posted == []
    page.keyboard.press("Escape")
    until(page, lambda: state(page) == "stopped")


def test_an_old_picture_is_marked_over_the_whole_frame(page: Any, fake: FakeConsole) -> None:
    until(page, lambda: page.locator(".camera:not(.none, .stale)").count() == 1)
    fake.pictures = False
    # on a busy host one that was on its way comes after the mark, and takes it away once more
    over, frame = page.locator(".camera.stale .over"), page.locator(".camera")
    until(page, lambda: over.count() == 1 and over.bounding_box() == frame.bounding_box())
    until(page, lambda: "OLD" in page.inner_text(".over"))


def test_markup_from_the_robot_is_text(page: Any, fake: FakeConsole) -> None:
    evil = "<img src=x onerror=alert(1)><b>bold</b>"
    fake.view = {"reason": evil, "operator": evil}
    fake.facts = {
        "events": [{"id": 99, "age_s": 0.0, "what": "hold", "text": evil}],
        "faults": {evil: evil},
        "doubt": evil,
        "shift": [evil],
    }
    until(page, lambda: page.inner_text("#why") == evil)
    until(page, lambda: evil in page.inner_text("#events"))
    assert page.locator("img").count() == 0
    assert page.locator("#events p b", has_text="bold").count() == 0


def test_a_page_that_stood_still_does_not_replay_the_past(page: Any, fake: FakeConsole) -> None:
    until(page, lambda: state(page) == "follows")
    page.evaluate("{ const end = performance.now() + 3000; while (performance.now() < end); }")
    until(page, lambda: state(page) == "follows")
    assert fake.most_unacknowledged <= 10  # the window of 8, and a picture and facts of one turn


def test_a_replay_is_striped_and_cannot_stop(page: Any, fake: FakeConsole) -> None:
    fake.setup = {"replay": True}
    page.reload()
    until(page, lambda: page.evaluate("document.body.classList.contains('replay')"))
    page.keyboard.press("Escape")
    page.wait_for_timeout(200)
    assert fake.of_kind("stop") == []
    assert "REPLAY" in page.inner_text("#badges")


def test_in_chinese_the_robots_words_are_introduced(page: Any, fake: FakeConsole) -> None:
    until(page, lambda: state(page) == "follows")
    page.keyboard.press("F7")
    until(page, lambda: page.inner_text("#why") == "机器人跟随操作者。 follows nurse-1")
    assert page.inner_text("#events li:first-child p").startswith("保持")


def test_without_a_log_in_it_shows_nothing_and_stops(page: Any, fake: FakeConsole) -> None:
    fake.role, fake.may = "nobody", {"stop": True, "act": False, "reset": False, "hold": False}
    page.reload()
    until(page, lambda: state(page) == "locked")
    page.wait_for_timeout(2500)
    assert state(page) == "locked"
    assert not page.is_visible("#home h2")
    page.keyboard.press("Escape")
    until(page, lambda: bool(fake.of_kind("stop")))
    page.click("#login")
    page.fill("#sheet-field", "secret")
    page.keyboard.press("Enter")
    until(page, lambda: ("login", {"token": "secret"}) in fake.posted)


def test_the_token_in_the_address_is_used_once_and_removed(page: Any, fake: FakeConsole) -> None:
    page.goto(f"{fake.address}/#token=abc")
    page.reload()
    until(page, lambda: ("login", {"token": "abc"}) in fake.posted)
    until(page, lambda: "token" not in page.url)


def test_reset_asks_for_the_key_and_esc_still_stops(page: Any, fake: FakeConsole) -> None:
    until(page, lambda: state(page) == "follows")
    page.keyboard.press("Escape")
    until(page, lambda: page.is_visible("#reset"))
    page.click("#reset")
    page.keyboard.type("a key")  # a blank in the key is no stop
    stops = len(fake.of_kind("stop"))
    page.keyboard.press("Escape")
    until(page, lambda: len(fake.of_kind("stop")) > stops)
    page.keyboard.press("Enter")
    until(page, lambda: ("act", {"act": "reset", "robot": "robot-1", "key": "a key"}) in fake.posted)
    until(page, lambda: not page.is_visible("#sheet"))


def test_only_a_hardware_stop_says_emergency(page: Any, fake: FakeConsole) -> None:
    until(page, lambda: page.inner_text("#stop-word") == "STOP THE ROBOT")
    fake.setup = {"hardware_estop": True}
    page.reload()
    until(page, lambda: page.inner_text("#stop-word") == "EMERGENCY STOP")


def test_a_frozen_page_shows_the_present_when_it_goes_on(page: Any, fake: FakeConsole) -> None:
    until(page, lambda: state(page) == "follows")
    devtools = page.context.new_cdp_session(page)
    devtools.send("Page.setWebLifecycleState", {"state": "frozen"})
    time.sleep(2.0)
    fake.guard, fake.reason = "hold", "nobody has engaged"
    devtools.send("Page.setWebLifecycleState", {"state": "active"})
    until(page, lambda: state(page) == "holds")
    assert fake.most_unacknowledged <= 10


def test_the_study_page_leads_through_steps_and_sends_answers_to_each_question(
    page: Any, fake: FakeConsole
) -> None:
    fake.facts = {"study": STUDY}
    fake.reports = [{"name": "trial/report.html", "path": "/reports/trial/report.html", "words": "today"}]
    page.goto(f"{fake.address}/study")
    until(page, lambda: page.inner_text("#step-name") == "questions")
    assert page.inner_text("#step-text") == "Answer."
    until(page, lambda: re.fullmatch(r"4[5-8] s left", page.inner_text("#step-left")) is not None)
    until(page, lambda: page.locator("#questions fieldset").count() == 6)
    assert page.get_attribute("#report-list a", "href") == "/reports/trial/report.html"
    page.click("#questions [type=submit]")
    until(page, lambda: page.locator("#questions .missing").count() == 1)
    assert not [what for what, _ in fake.posted if what == "study"], "no slider was touched"
    for slider in page.locator("#questions [type=range]").all():
        slider.focus()
        page.keyboard.press("ArrowRight")
    page.click("#questions [type=submit]")
    given = {"do": "answers", "questionnaire": "nasa-tlx"}
    answers = dict.fromkeys(("mental", "physical", "temporal", "performance", "effort", "frustration"), 55)
    until(page, lambda: ("study", {**given, "answers": answers}) in fake.posted)
    page.click("#step-next")
    until(page, lambda: ("study", {"do": "next"}) in fake.posted)
    page.click("#step-end")
    page.click("#step-end")
    until(page, lambda: ("study", {"do": "end"}) in fake.posted)
    page.keyboard.press("F7")
    until(page, lambda: page.inner_text("#step-text") == "请填写。")


def test_a_joint_that_a_limit_holds_back_is_named(page: Any, fake: FakeConsole) -> None:
    page.wait_for_selector("#scene canvas")
    fake.view = {"limited": [3]}
    page.click("#show-joints")
    until(page, lambda: page.locator("#joints tr.limited").count() == 1)


@pytest.mark.parametrize("path", ["/", "/engineer", "/study", "/calibrate"])
def test_every_page_has_the_banner_the_stop_and_the_keys(page: Any, fake: FakeConsole, path: str) -> None:
    page.goto(fake.address + path)
    until(page, lambda: state(page) == "follows")
    assert page.locator("#pages a:visible").count() == 3  # not to itself
    page.keyboard.press("Escape")
    until(page, lambda: ("stop", {"robot": "robot-1"}) in fake.posted)


def test_the_picture_of_one_robot_never_stands_under_the_name_of_another(
    page: Any, fake: FakeConsole
) -> None:
    until(page, lambda: page.locator(".camera:not(.none)").count() == 1)
    fake.pictures = False
    page.route("**/api/setup*", lambda route: None)  # the line is slow: what follows is not known yet
    page.select_option("#robot", "robot-2")
    until(page, lambda: "robot-2" in page.title())
    assert page.locator(".camera:not(.none)").count() == 0


def test_what_is_still_being_decoded_is_not_shown_after_another_robot_was_opened(page: Any) -> None:
    shown = page.evaluate("""async () => {
      const { Pictures } = await import("/page/video.js");
      const canvas = new OffscreenCanvas(8, 8);
      canvas.getContext("2d");
      const bytes = new Uint8Array(await (await canvas.convertToBlob({ type: "image/jpeg" })).arrayBuffer());
      const [pictures, shown] = [new Pictures(() => {}, () => {}), []];
      const before = pictures.take({ camera: "head", number: 1 }, bytes, ({ number }) => shown.push(number));
      pictures.clear();
      await pictures.take({ camera: "head", number: 2 }, bytes, ({ number }) => shown.push(number));
      await before;
      return shown;
    }""")
    assert shown == [2]


def test_before_anything_is_shown_the_stop_is_for_the_robot_that_was_asked_for(
    page: Any, fake: FakeConsole
) -> None:
    """A log-in that has ended: the console greets with its first robot, and shows nothing."""
    fake.role, fake.may = "nobody", {"stop": True, "act": False, "reset": False, "hold": False}
    page.goto(f"{fake.address}/?robot=ward-3")
    until(page, lambda: state(page) == "locked")
    page.keyboard.press("Escape")
    until(page, lambda: ("stop", {"robot": "ward-3"}) in fake.posted)
