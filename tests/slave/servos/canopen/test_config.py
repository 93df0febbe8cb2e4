from __future__ import annotations

import pytest

from common.skeleton import load_skeleton
from slave.backends import ServosConfig
from slave.encoders.counts import EncoderConfig
from slave.servos.canopen.config import CanopenConfig
from slave.servos.canopen.drive_config import DriveConfig

NURSING = load_skeleton("nursing")


@pytest.mark.parametrize("profile", ["nursing", "hand", "lower_limb"])
def test_without_any_drives_each_joint_has_one(profile: str) -> None:
    skeleton = load_skeleton(profile)
    drives = CanopenConfig().drives_of(skeleton)
    assert tuple(drives) == skeleton.joint_names
    assert len({(d.bus, d.id) for d in drives.values()}) == len(drives)
    assert CanopenConfig().mistakes_for(skeleton, EncoderConfig()) == []


def with_drive(joint: str, **changes: object) -> CanopenConfig:
    drives = CanopenConfig().drives_of(NURSING)
    drives[joint] = drives[joint].model_copy(update=changes)
    return CanopenConfig(drives=drives)


@pytest.mark.parametrize(
    ("config", "key", "expected"),
    [
        (with_drive("neck_pitch", id=1), "drives.neck_pitch.id", "an id that neck_yaw does not have"),
        (with_drive("neck_yaw", bus="middle"), "drives.neck_yaw.bus", "one of left, right"),
        (with_drive("neck_yaw", gear_ratio=1e4, increments_per_turn=2**24), "neck_yaw.gear_ratio", "32 bits"),
        (with_drive("neck_yaw", lower_deg=90.0, upper_deg=10.0), "neck_yaw.lower_deg", "less than upper_deg"),
        (CanopenConfig(drives={"tail": DriveConfig(id=1, bus="left")}), "drives.tail", "a joint of"),
        (CanopenConfig(drives={"neck_yaw": DriveConfig(id=1, bus="left")}), "neck_pitch", "a drive for each"),
        (CanopenConfig(dead_ms=100), "dead_ms", "three heartbeats"),
        (CanopenConfig(drive_dead_ms=200), "drive_dead_ms", "three times"),
        (CanopenConfig(sync_hz=60), "sync_hz", "whole milliseconds"),
        (CanopenConfig(node_id=3), "drives.waist_pitch.id", "an id that the slave does not have"),
    ],
)
def test_a_mistake_names_key_and_expectation(config: CanopenConfig, key: str, expected: str) -> None:
    mistakes = config.mistakes_for(NURSING, EncoderConfig())
    assert any(key in m.key and expected in m.expected for m in mistakes), mistakes


def test_a_robot_without_these_drives_is_not_asked_about_them() -> None:
    wrong = CanopenConfig(sync_hz=60)
    assert ServosConfig(canopen=wrong).mistakes_for(NURSING, EncoderConfig()) == []
    assert ServosConfig(backend="canopen", canopen=wrong).mistakes_for(NURSING, EncoderConfig())
