"""The page reads the time out of the pictures that it shows, and reports when each was on the screen."""

from __future__ import annotations

import io
from typing import Any

import numpy as np
import pytest
from PIL import Image

from common.clock import monotonic_ns
from common.picture_code import newest_ns, read_codes, resolve_ns
from deploy.console.model.glass import read_shown
from tests.browser.console.browser import CHROMIUM
from tests.browser.console.fake import FakeConsole
from tests.browser.console.steps import until

pytestmark = [
    pytest.mark.live,
    pytest.mark.skipif(CHROMIUM is None, reason="no chromium here: apt install chromium"),
]


def test_shown_pictures_are_reported_with_their_own_time(page: Any, fake: FakeConsole) -> None:
    fake.coded = True
    until(page, lambda: len(fake.of_kind("shown")) >= 8, 60.0)
    now_ns = monotonic_ns()
    reports = [read_shown(message, now_ns) for message in fake.of_kind("shown")]
    shown = [report for report in reports if report is not None]
    assert len(shown) >= 3
    late_ns = [each.at_ns - resolve_ns(each.counts[0], now_ns) for each in shown]
    # never before it was drawn; how much later depends on what else this machine does
    assert all(late > -each.bound_ns for late, each in zip(late_ns, shown, strict=True))
    assert min(late_ns) < 5_000_000_000
    fake.facts = {"glass": {"head": {"ms": 104.2, "bound_ms": 20.1}}}
    until(page, lambda: page.inner_text("#glass") == "scene to eye 104 ± 21 ms", 30.0)
    fake.facts = {"glass": {}}
    until(page, lambda: page.inner_text("#glass") == "")


def test_a_picture_without_a_code_is_not_reported(page: Any, fake: FakeConsole) -> None:
    until(page, lambda: page.evaluate("Boolean(document.querySelector('.camera:not(.none)'))"), 30.0)
    page.wait_for_timeout(1200)
    assert fake.of_kind("shown") == []


def test_the_screen_for_a_camera_shows_this_hosts_time(page: Any, fake: FakeConsole) -> None:
    page.goto(f"{fake.address}/code")
    until(page, lambda: "±" in page.inner_text("#told"))
    picture = np.asarray(Image.open(io.BytesIO(page.screenshot())).convert("RGB"))
    codes = read_codes(picture)
    now_ns = monotonic_ns()
    shown_ns = newest_ns(codes, now_ns)
    assert len(codes) == 2
    assert shown_ns is not None
    assert 0 < now_ns - shown_ns < 10_000_000_000
