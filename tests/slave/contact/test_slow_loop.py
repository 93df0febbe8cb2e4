"""A loop slower than the one in which all thresholds were judged knows torques later."""

from __future__ import annotations

import pytest

from common.config.load import load_config
from deploy.examples.profiles import NURSING, example
from slave.config import SlaveConfig
from slave.contact.config import ContactConfig
from slave.pipeline import SlavePipeline


@pytest.mark.parametrize(("loop_hz", "times"), [(1000, 1.0), (200, 1.0), (199, (200 / 199) ** 2), (100, 4.0)])
def test_torques_are_known_later_by_the_square_of_the_loops_period(loop_hz: int, times: float) -> None:
    config = ContactConfig(effort_late_s=0.005)
    assert config.for_loop(loop_hz).effort_late_s == pytest.approx(0.005 * times)
    assert config.for_loop(loop_hz).reflex is config.reflex


def test_the_watch_of_a_slow_robot_allows_for_it() -> None:
    """By the file's own rate; `tests/whole_way/test_slow_loop.py` shows what it is for."""
    usual, slow = (
        SlavePipeline(load_config(example("slave", NURSING), SlaveConfig, [f"loop.rate_hz={hz}"]))
        for hz in (200, 100)
    )
    assert slow.contact.observer._late_s == pytest.approx(4.0 * usual.contact.observer._late_s)
