"""Tilt from level and the simulated base, on a clock that is given."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from common.config.load import load_config
from common.errors import ConfigError
from common.quaternion import conjugate, from_axis_angle, multiply, rotate
from slave.attitude.angles import gravity_tool_face_rad, inclination_rad, orientation
from slave.attitude.base import Axis, base_attitude, tilt_rad
from slave.attitude.config import BaseConfig
from slave.attitude.open import open_base
from slave.attitude.simulated_base import SimulatedBase
from slave.config import SlaveConfig

EXAMPLE = Path(__file__).parents[3] / "deploy" / "examples" / "slave.toml"
LEVEL = {
    "ahead": orientation(np.asarray(math.pi / 2), np.asarray(1.0), np.asarray(0.0)),
    "up": orientation(np.asarray(0.0), np.asarray(1.0), np.asarray(0.0)),
}
PERIOD_NS = 20_000_000


class Clock:
    now_ns = 0

    def __call__(self) -> int:
        return self.now_ns


@settings(max_examples=100, derandomize=True, deadline=None)
@given(st.sampled_from(["ahead", "up"]), st.floats(0.0, math.tau), st.floats(0.0, math.pi))
def test_tilt_is_the_angle_the_base_tipped_in_any_direction(axis: Axis, direction: float, tip: float) -> None:
    about = [math.cos(direction), math.sin(direction), 0.0]
    q = multiply(from_axis_angle(about, tip), LEVEL[axis])
    up = rotate(conjugate(q), np.array([0.0, 0.0, 9.8]))
    assert tilt_rad(up, axis) == pytest.approx(tip, abs=1e-9)
    inclination, tool_face = float(inclination_rad(up)), float(gravity_tool_face_rad(up))
    told = base_attitude(1, inclination, None, None if math.isnan(tool_face) else tool_face, axis)
    near = min(inclination, math.pi - inclination) < math.radians(5.0)
    if axis == "ahead" and near:
        # on end: its tool-face may be the field's and tell nothing of gravity
        assert told is not None
        assert abs(told.tilt_rad - tip) < math.radians(5.1)
    else:
        assert told is not None
        assert told.tilt_rad == pytest.approx(tip, abs=1e-6)


@pytest.mark.parametrize("axis", ["ahead", "up"])
def test_a_simulated_base_stands_level_then_leans(axis: Axis) -> None:
    clock = Clock()
    config = BaseConfig(source="simulated", axis=axis, lean_deg=20.0, lean_after_s=3.0, declination_deg=2.0)
    base = SimulatedBase(config, clock)
    base.start()
    assert (first := base.read()) is not None
    assert first.measured_ns == 0
    tilts = []
    for tick in range(1, 200):
        clock.now_ns = tick * PERIOD_NS
        now = base.read()
        assert now is not None
        assert now.measured_ns == clock.now_ns
        assert base.read() is now, "measured at most once a period"
        tilts.append(math.degrees(now.tilt_rad))
        if tick == 140:
            assert (now.azimuth_rad is None) == (axis == "up")
            if now.azimuth_rad is not None:
                assert math.degrees(now.azimuth_rad) == pytest.approx(math.degrees(0.5) + 2.0, abs=0.5)
    assert max(tilts[20:149]) < 0.5
    # the limit is judged by readings of the last tenths of a second, not of two seconds
    assert tilts[149 + 25] == pytest.approx(20.0, abs=1.0)
    assert base.counters() == {"measurements": 200}


def test_a_late_reader_gets_one_fresh_measurement_and_no_burst() -> None:
    clock = Clock()
    base = SimulatedBase(BaseConfig(source="simulated"), clock)
    base.start()
    clock.now_ns = 10 * PERIOD_NS + 7
    assert (late := base.read()) is not None
    assert late.measured_ns == clock.now_ns
    clock.now_ns += 1
    assert base.read() is late
    clock.now_ns = 11 * PERIOD_NS
    assert base.read() is not late
    assert base.counters() == {"measurements": 2}


def test_no_base_sensor_is_none() -> None:
    assert open_base(BaseConfig()) is None


def test_a_missing_calibration_is_reported_before_anything_is_opened(tmp_path: Path) -> None:
    config = BaseConfig(source="simulated", calibration=tmp_path / "none.toml")
    with pytest.raises(ConfigError, match=r"none\.toml"):
        open_base(config)


@pytest.mark.parametrize(
    ("override", "expected"),
    [
        ('base.source="magic"', ["base.source = 'magic'", "'serial'"]),
        ('base.source="serial"', ["base.port", "/dev/ttyUSB0"]),
        ("base.declination_deg=200.0", ["base.declination_deg = 200.0", "180"]),
        ('base.axis="down"', ["base.axis = 'down'", "'ahead'"]),
        ("base.tilt=3.0", ["base.tilt", "no such key"]),
    ],
)
def test_one_line_a_mistake(override: str, expected: list[str]) -> None:
    with pytest.raises(ConfigError) as caught:
        load_config(EXAMPLE, SlaveConfig, [override])
    lines = str(caught.value).splitlines()
    assert len(lines) == 1
    for part in expected:
        assert part in lines[0]
