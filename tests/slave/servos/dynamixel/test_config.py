"""What a file may ask of the serial bus, and how a mistake is told."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from common.config.load import load_config
from common.errors import ConfigError
from slave.config import SlaveConfig
from slave.encoders.counts import Encoders
from slave.servos.dynamixel import registers as x
from slave.servos.dynamixel.config import DynamixelConfig
from slave.servos.dynamixel.servos import DynamixelServos
from slave.servos.dynamixel.settings import settings_of

EXAMPLE = Path(__file__).parents[4] / "deploy" / "examples" / "dynamixel.toml"
KEY = "servos.dynamixel"


def test_the_example_is_a_whole_robot() -> None:
    config = load_config(EXAMPLE, SlaveConfig)
    assert isinstance(config.servos.open(config.skeleton, config.encoders), DynamixelServos)
    assert config.servos.section(DynamixelConfig).wire_time_s() == pytest.approx(6.1e-3, abs=0.1e-3)


@pytest.mark.parametrize(
    ("override", "key", "expected"),
    [
        (f"{KEY}.ids.left_tail=77", f"{KEY}.ids.left_tail", "a joint of the nursing profile"),
        (f"{KEY}.ids.neck_pitch=1", f"{KEY}.ids.neck_pitch", "neck_yaw has this one"),
        (f"{KEY}.ids.neck_pitch=253", f"{KEY}.ids.neck_pitch", "less than or equal to 252"),
        (f"{KEY}.ids={{neck_yaw=1}}", f"{KEY}.ids.right_little", "the id of its servo"),
        (f"{KEY}.baud=115200", f"{KEY}.rate_hz", "at most 15: at 115200 baud"),
        (f"{KEY}.bus_watchdog_s=0.02", f"{KEY}.bus_watchdog_s", "at least three cycles, 0.03"),
        ("encoders.zero_counts.neck_yaw=700", "encoders.zero_counts.neck_yaw", "796 to 3299"),
        (
            "encoders.zero_counts.neck_yaw=3300",
            "encoders.zero_counts.neck_yaw",
            "the servo's own end of turn",
        ),
        ('encoders.reversed=["nose"]', "encoders.reversed", "a joint of the nursing profile"),
    ],
)
def test_a_mistake_names_its_key_and_what_was_expected(override: str, key: str, expected: str) -> None:
    with pytest.raises(ConfigError) as raised:
        load_config(EXAMPLE, SlaveConfig, [override])
    assert key in str(raised.value)
    assert expected in str(raised.value)


def test_a_backend_without_its_section_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "slave.toml"
    file.write_text('robot = "r"\n[link]\nlisten = ["tcp/0.0.0.0:7447"]\n[servos]\nbackend = "dynamixel"\n')
    with pytest.raises(ConfigError, match=r"servos.dynamixel = \(not set\): expected a section with port"):
        load_config(file, SlaveConfig)


def test_servos_go_as_far_and_fast_as_the_table_and_little_more() -> None:
    config = load_config(EXAMPLE, SlaveConfig, ['encoders.reversed=["neck_pitch"]'])
    encoders = Encoders(config.skeleton, config.encoders)
    found = settings_of(config.servos.section(DynamixelConfig), config.skeleton, encoders)
    for servo, joint in zip(found, config.skeleton.joints, strict=True):
        span = (servo.highest - servo.lowest) * 2 * np.pi / 4096
        assert np.deg2rad(5.8) < span - (joint.upper_rad - joint.lower_rad) < np.deg2rad(6.2)
        fastest = servo.velocity * x.RAD_S_PER_UNIT
        assert 1.25 * joint.max_velocity_rad_s <= fastest < 1.25 * joint.max_velocity_rad_s + x.RAD_S_PER_UNIT
