from __future__ import annotations

from pathlib import Path

import pytest

from common.config.load import load_config
from common.errors import ConfigError
from deploy.sim.suit.config import SuitConfig

GOOD = """
[[buses]]
name = "suit"
interface = "virtual"
channel = "x"
[nodes]
chest = { id = 1, bus = "suit" }
head = { id = 2, bus = "suit" }
"""


@pytest.fixture
def path(tmp_path: Path) -> Path:
    path = tmp_path / "suit.toml"
    path.write_text(GOOD)
    return path


def test_a_short_file_is_enough(path: Path) -> None:
    config = load_config(path, SuitConfig)
    assert (config.motion, config.grade, config.seed, config.replay) == ("bottle", "calibrated", 0, None)
    assert config.dbc.is_file()


def test_all_keys(path: Path) -> None:
    config = load_config(
        path,
        SuitConfig,
        [
            'grade = "raw"',
            'motion = "sweep"',
            "seed = 7",
            "field = { strength_ut = 48.5, dip_deg = -20 }",
            "alignment = { head = [0, 1, 0, 0] }",
            'replay = "person.npz"',
            'faults = { corrupt_rate = 0.1, lose = [{ node = "head", from_s = 1, until_s = 2.5 }] }',
            'link.connect = ["tcp/127.0.0.1:7447"]',
        ],
    )
    assert config.replay == path.parent / "person.npz"
    assert config.faults.lose[0].until_s == 2.5
    assert config.alignment == {"head": [0.0, 1.0, 0.0, 0.0]}


@pytest.mark.parametrize(
    ("override", "said"),
    [
        ('motion = "dance"', "motion = 'dance': expected one of bottle, crossed, calibration_pose, sweep"),
        ('grade = "good"', "grade = 'good': expected 'ideal', 'calibrated' or 'raw'"),
        ("seed = -1", "seed = -1: expected greater than or equal to 0"),
        ("sead = 1", "sead = 1: expected no such key"),
        ("buses = []", "buses = .*: "),
        ('profile = "horse"', "profile = 'horse': expected one of"),
        ('nodes.tail = { id = 3, bus = "suit" }', "nodes.tail = 'tail': expected a segment of the profile"),
        (
            'nodes.left_hand = { id = 2, bus = "suit" }',
            "nodes.left_hand.id = 2: expected an id that nodes.head",
        ),
        ('nodes.left_hand = { id = 3, bus = "can7" }', "nodes.left_hand.bus = 'can7': expected one of suit"),
        ("alignment.tail = [1, 0, 0, 0]", "alignment.tail = 'tail': expected a segment"),
        ("alignment.head = [1, 1, 0, 0]", r"alignment.head = \[1.0, 1.0, 0.0, 0.0\]: expected a quaternion"),
        ("alignment.head = [1, 0, 0]", "alignment.head = .*at least 4 items"),
        ("alignment.head = [nan, 0, 0, 0]", "alignment.head.0 = nan: expected a finite number"),
        ("faults.corrupt_rate = 1.1", "faults.corrupt_rate = 1.1: expected less than or equal to 1"),
        ("faults.delay = [{ delay_ms = 0 }]", "faults.delay.0.delay_ms = 0: expected greater than 0"),
        (
            'faults.delay = [{ delay_ms = 1, node = "left_hand" }]',
            "faults.delay.0.node = 'left_hand': expected the segment of a configured node",
        ),
        ('faults.lose = [{ node = "tail" }]', "faults.lose.0.node = 'tail': expected the segment of"),
        ("field.strength_ut = 0", "field.strength_ut = 0: expected greater than 0"),
    ],
)
def test_a_mistake_is_told_in_one_line(path: Path, override: str, said: str) -> None:
    with pytest.raises(ConfigError, match=said) as refused:
        load_config(path, SuitConfig, [override])
    assert len(str(refused.value).splitlines()) == 1


def test_two_buses_of_one_name(path: Path) -> None:
    path.write_text('[[buses]]\nname = "suit"\ninterface = "virtual"\nchannel = "y"\n' + GOOD)
    with pytest.raises(ConfigError, match="buses = 'suit': expected a bus name used once"):
        load_config(path, SuitConfig)
