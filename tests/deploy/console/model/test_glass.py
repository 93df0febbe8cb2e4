"""From scene to eye: what pages report, and what is made of it."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.clock_sync import Offset
from common.picture_code import count_of
from deploy.console.model.glass import GlassWatch, ShownPicture, read_shown

NOW = 50_000_000_000_000
GOOD = {"kind": "shown", "camera": "head", "number": 7, "counts": [1], "at_ms": NOW / 1e6, "bound_ms": 17.0}


@given(
    st.integers(10**12, 10**15),
    st.integers(-(10**11), 10**11),
    st.integers(0, 2 * 10**9),
    st.integers(0, 10**8),
)
def test_the_figure_is_the_time_on_the_screen_less_the_time_in_the_picture(
    scene_ns: int, offset_ns: int, late_ns: int, bound_ns: int
) -> None:
    watch, offset = GlassWatch(), Offset(offset_ns, bound_ns, trusted=True)
    at_ns = scene_ns + offset_ns + late_ns  # this host's clock
    shown = ShownPicture("head", 7, (count_of(scene_ns), count_of(scene_ns - 33_000_000)), at_ns, 17_000_000)
    measured = watch.add(shown, offset, scene_ns - 5_000_000)
    assert measured is not None
    assert 0 <= measured - late_ns < 100_000  # a code's step
    told = watch.shown(at_ns)["head"]
    assert told["bound_ms"] == pytest.approx(17.0 + bound_ns / 1e6, abs=0.06)
    assert told["stamp_off_ms"] == pytest.approx(5.0, abs=0.16)
    assert told["count"] == 1


def test_without_a_trusted_offset_nothing_is_said() -> None:
    watch = GlassWatch()
    shown = ShownPicture("head", 7, (1,), NOW, 0)
    assert watch.add(shown, None, None) is None
    assert watch.add(shown, Offset(0, 0, trusted=False), None) is None
    assert watch.shown(NOW) == {}


def test_an_old_figure_is_not_shown() -> None:
    watch = GlassWatch()
    watch.add(ShownPicture("head", 7, (count_of(NOW),), NOW, 0), Offset(0, 0, trusted=True), None)
    assert "head" in watch.shown(NOW + 10_000_000_000)
    assert watch.shown(NOW + 10_000_000_001) == {}


def test_a_whole_report_is_taken() -> None:
    assert read_shown(GOOD, NOW) == ShownPicture("head", 7, (1,), NOW, 17_000_000)


@pytest.mark.parametrize(
    "wrong",
    [
        {"camera": 1}, {"number": "7"}, {"number": True}, {"counts": []}, {"counts": [1] * 5},
        {"counts": [2**32]}, {"counts": [-1]}, {"counts": ["1"]}, {"counts": 1}, {"at_ms": None},
        {"at_ms": float("nan")},
        {"at_ms": 1e300}, {"at_ms": NOW / 1e6 - 10_001}, {"bound_ms": -1.0}, {"bound_ms": float("inf")},
        {"bound_ms": 10_001.0},
    ],
)  # fmt: skip
def test_a_report_that_cannot_be_is_not(wrong: dict[str, Any]) -> None:
    assert read_shown({**GOOD, **wrong}, NOW) is None
