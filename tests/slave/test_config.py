"""Each mistake in the slave's file gives one clear line: file, key, value and what was expected."""

from __future__ import annotations

from pathlib import Path

import pytest

from common.config.load import load_config
from common.errors import ConfigError
from deploy.examples.profiles import NURSING, example
from slave.config import SlaveConfig

EXAMPLE = Path(__file__).parents[2] / "deploy" / "examples" / "slave.toml"


def test_the_example_is_right() -> None:
    assert load_config(EXAMPLE, SlaveConfig).track.strategy == "predict"


@pytest.mark.parametrize(
    ("override", "expected"),
    [
        ("guard.command_timeout=0.1", ["guard.command_timeout = 0.1", "no such key"]),
        ('guard.command_timeout_s="soon"', ["guard.command_timeout_s = 'soon'", "number"]),
        ("guard.command_timeout_s=0.0", ["guard.command_timeout_s = 0.0", "greater than 0"]),
        ("guard.joints.left_tail.upper_deg=3.0", ["guard.joints.left_tail", "a joint of nursing"]),
        ("guard.joints.neck_yaw.upper_deg=75.0", ["guard.joints.neck_yaw.upper_deg = 75.0", "skeleton's"]),
        ("guard.max_blind_cm=0.9", ["guard.max_blind_cm = 0.9", "greater than or equal to 1"]),
        ("guard.velocity_scale=1.5", ["guard.velocity_scale = 1.5", "less than or equal to 1"]),
        ("encoders.zero_counts.tail=1", ["encoders.zero_counts", "joint"]),
        ("track.strategy='guess'", ["track.strategy = 'guess'", "'latest'"]),
        ("loop.rate_hz=5", ["loop.rate_hz = 5", "greater than or equal to 20"]),
        ("servos.backend='steam'", ["servos.backend = 'steam'", "'mujoco'"]),
    ],
)
def test_one_line_a_mistake(override: str, expected: list[str]) -> None:
    with pytest.raises(ConfigError) as caught:
        load_config(EXAMPLE, SlaveConfig, [override])
    lines = str(caught.value).splitlines()
    assert len(lines) == 1
    for part in (str(EXAMPLE), *expected):
        assert part in lines[0]


def test_a_file_that_leaves_out_a_drive_names_the_joint() -> None:
    """It ended with a KeyError before: zones were asked for efforts of drives that the file does not have."""
    overrides = ['servos.backend="canopen"', 'servos.canopen.drives.neck_yaw={id=1, bus="left"}']
    with pytest.raises(ConfigError, match=r"servos\.canopen\.drives\.neck_pitch = .*a drive for each joint"):
        load_config(example("slave", NURSING), SlaveConfig, overrides)


@pytest.mark.parametrize(
    ("source", "limit_s", "refused"),
    [("robot", 3.99, True), ("robot", 4.0, False), ("robot", 0.0, False), ("off", 0.5, False)],
)
def test_pictures_may_be_as_old_as_a_camera_on_a_poor_link_makes_them(
    source: str, limit_s: float, refused: bool
) -> None:
    overrides = [
        f'camera.source="{source}"', "camera.least_rate_hz=0.5", f"guard.max_video_age_s={limit_s}"
    ]  # fmt: skip
    if not refused:
        assert load_config(EXAMPLE, SlaveConfig, overrides).guard.max_video_age_s == limit_s
        return
    with pytest.raises(ConfigError, match=r"guard\.max_video_age_s = 3\.99.*at least 4: two pictures"):
        load_config(EXAMPLE, SlaveConfig, overrides)
