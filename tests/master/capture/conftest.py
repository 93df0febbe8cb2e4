"""Three other makers' layouts, and nodes that swing at up to 90°/s."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from common.config.load import check_config
from common.quaternion import Array, conjugate, from_axis_angle, multiply, rotate
from deploy.sim.suit.free_running import Reading
from master.capture.config import SuitSection
from master.capture.layout import MappedLayout, load_layout

LAYOUTS = Path(__file__).with_name("layouts") / "layouts.toml"
FIELD_UT = np.array([0.0, 25.0, -43.3])
PEAK_RAD_S = math.radians(90.0)


def suit_section(name: str | None = None) -> SuitSection:
    table = tomllib.loads(LAYOUTS.read_text("utf-8"))
    if name is not None:
        table["layout"] = {name: table["layout"][name]}
    return check_config(LAYOUTS, table, SuitSection)


@pytest.fixture(scope="session")
def load() -> Callable[..., MappedLayout]:
    """Loads one of the three, for nodes with some numbers."""

    def read(name: str, *numbers: int) -> MappedLayout:
        return load_layout(name, suit_section().layout[name], numbers)

    return read


def swinging(seed: int, frequency_hz: float = 0.5, rest_s: float = 0.0) -> Reading:
    """A node that rests, then swings about an axis of its own, up to 90°/s."""
    random = np.random.default_rng(seed)
    axis = random.normal(size=3)
    axis /= np.linalg.norm(axis)
    q_start = random.normal(size=4)
    q_start /= np.linalg.norm(q_start)
    pace = 2.0 * math.pi * frequency_hz

    def reading(time_s: float) -> tuple[Array, Array]:
        t = max(time_s - rest_s, 0.0)
        angle, rate = PEAK_RAD_S / pace * (1.0 - math.cos(pace * t)), PEAK_RAD_S * math.sin(pace * t)
        q = multiply(q_start, from_axis_angle(axis, angle))
        acc = rotate(conjugate(q), np.array([0.0, 0.0, 9.80665]))
        return np.concatenate([acc, rate * axis, rotate(conjugate(q), FIELD_UT)]), q

    return reading


@pytest.fixture(scope="session")
def swing() -> Callable[..., Reading]:
    """Makes such a node's readings."""
    return swinging
