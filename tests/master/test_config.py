"""Each mistake in the master's file gives one clear line: file, key, value and what was expected."""

from __future__ import annotations

from pathlib import Path

import pytest

from common.config.load import load_config
from common.errors import ConfigError
from master.config import MasterConfig

EXAMPLE = Path(__file__).parents[2] / "deploy" / "examples" / "master.toml"


def mistakes(*overrides: str) -> list[str]:
    with pytest.raises(ConfigError) as caught:
        load_config(EXAMPLE, MasterConfig, overrides)
    return str(caught.value).splitlines()


def test_the_example_is_right() -> None:
    config = load_config(EXAMPLE, MasterConfig)
    assert len(config.nodes) == 36
    assert config.capture.dbc.is_file()


def test_robots_are_named_in_a_list_or_one_alone() -> None:
    assert load_config(EXAMPLE, MasterConfig).commanded == ["robot-1"]
    assert load_config(EXAMPLE, MasterConfig, ["robots=['b', 'a']"]).commanded == ["b", "a"]
    assert load_config(EXAMPLE, MasterConfig, ["robots=[]", "robot='b'"]).commanded == ["b"]


def test_robots_of_a_pattern_are_watched() -> None:
    everybody = load_config(EXAMPLE, MasterConfig, ["robots='*'"])
    assert (everybody.commanded, everybody.watched) == ([], ["*"])
    some = load_config(EXAMPLE, MasterConfig, ["robots=['a', 'ward-*']"])
    assert (some.commanded, some.watched) == (["a"], ["ward-*"])


@pytest.mark.parametrize(
    ("override", "expected"),
    [
        ("capture.rate_hs=200", ["capture.rate_hs = 200", "no such key"]),
        ('capture.rate_hz="fast"', ["capture.rate_hz = 'fast'", "integer"]),
        ("capture.rate_hz=0", ["capture.rate_hz = 0", "greater than or equal to 10"]),
        ("capture.rate_hz=100000", ["capture.rate_hz = 100000", "less than or equal to 1000"]),
        ("capture.decimation=0", ["capture.decimation = 0", "greater than or equal to 1"]),
        ("nodes.tail={id=99, bus='suit'}", ["nodes.tail", "a segment of the profile nursing"]),
        ("nodes.head.id=1", ["nodes.head.id = 1", "nodes.chest"]),
        ("nodes.head.id=0", ["nodes.head.id = 0", "greater than or equal to 1"]),
        ("nodes.head.bus='left'", ["nodes.head.bus = 'left'", "one of suit"]),
        ("profile='octopus'", ["profile = 'octopus'", "nursing"]),
        ("estimation.gyroscope_cutoff_hz=100.0", ["gyroscope_cutoff_hz = 100.0", "less than half the rate"]),
        ("estimation.filter='magic'", ["estimation.filter = 'magic'", "one of vqf, mahony, ekf"]),
        ("nodes.head.filter='magic'", ["nodes.head.filter = 'magic'", "one of vqf, mahony, ekf"]),
        ("estimation.mahony.kp=-1.0", ["estimation.mahony.kp = -1.0", "greater than or equal to 0"]),
        (
            "estimation.stance_s=1.0",
            ["estimation.stance_s = 1.0", "expected the key zero_pose_s, its new name"],
        ),
        ("estimation.magic.kp=1.0", ["estimation.magic = {'kp': 1.0}", "no such key"]),
        ("robot='robot 1'", ["robot = 'robot 1'", "pattern"]),
        ("robots=['robot 1']", ["robots.0 = 'robot 1'", "pattern"]),
        ("robots=[]", ["robots = []", "at least one robot"]),
        ("robots=['a', 'b', 'a']", ["robots = 'a'", "each robot once"]),
        ("robot='robot-2'", ["robot = 'robot-2'", "only one of robot and robots"]),
    ],
)
def test_one_line_a_mistake(override: str, expected: list[str]) -> None:
    lines = mistakes(override)
    assert len(lines) == 1
    for part in (str(EXAMPLE), *expected):
        assert part in lines[0]


def test_a_calibration_lies_beside_the_file_that_names_it(tmp_path: Path) -> None:
    moved = tmp_path / "master.toml"
    moved.write_text(EXAMPLE.read_text("utf-8"), "utf-8")
    config = load_config(moved, MasterConfig, ['nodes.head.calibration="nodes/head.toml"'])
    assert config.nodes["head"].calibration == tmp_path / "nodes" / "head.toml"
    assert config.nodes["chest"].calibration is None
    assert mistakes("nodes.head.calibration=3")[0].startswith(f"{EXAMPLE}: nodes.head.calibration = 3: ")


def test_a_missing_node_and_a_missing_deadman_are_named() -> None:
    text = EXAMPLE.read_text("utf-8").replace('head = { id = 2, bus = "suit" }\n', "")
    with pytest.raises(ConfigError, match=r"nodes\.head"):
        load_text(text)
    with pytest.raises(ConfigError, match=r"operator\.deadman"):
        load_text(EXAMPLE.read_text("utf-8").replace("[operator.deadman]", "[operator.pedal]"))


def load_text(text: str) -> MasterConfig:
    import tomllib

    from common.config.load import check_config

    return check_config(EXAMPLE, tomllib.loads(text), MasterConfig)


def test_a_path_that_no_file_can_have_is_named() -> None:
    (line,) = mistakes(r'nodes.head.calibration="a\u0000b.toml"')
    assert "nodes.head.calibration" in line
    assert "NUL" in line
