"""What a test does at the page, and waits for."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any


def until(page: Any, holds: Callable[[], bool], timeout_s: float = 8.0) -> None:
    end = time.monotonic() + timeout_s
    while not holds():
        assert time.monotonic() < end, f"not within {timeout_s:g} s; the page says {page.title()!r}"
        page.wait_for_timeout(20)


def state(page: Any) -> str:
    return str(page.evaluate("document.body.dataset.state"))
