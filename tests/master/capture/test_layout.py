"""What a person may write wrongly in a layout: each mistake is one line that says what to do."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest

from common.config.load import check_config, load_config
from common.errors import ConfigError
from common.quaternion import from_axis_angle, rotate
from master.capture.axes import permutation, quaternion_of
from master.capture.config import SuitSection
from master.capture.layout import load_layout
from master.config import MasterConfig

HERE = Path(__file__).with_name("layouts")
EXAMPLE = Path(__file__).parents[3] / "deploy/examples/master.toml"


def wrong(old: str, new: str, name: str) -> list[str]:
    """What is said of the layouts' file with one thing changed."""
    text = (HERE / "layouts.toml").read_text("utf-8")
    assert old in text
    try:
        section = check_config(HERE / "layouts.toml", tomllib.loads(text.replace(old, new, 1)), SuitSection)
        load_layout(name, section.layout[name], [1, 2])
    except ConfigError as error:
        return str(error).splitlines()
    return []


@pytest.mark.parametrize(
    ("name", "old", "new", "expected"),
    [
        ("mti", "RateOfTurn.gyrZ", "RateOfTurn.gyroZ", "a signal of XCDI_RateOfTurn: gyrX, gyrY, gyrZ"),
        ("mti", "XCDI_RateOfTurn.gyrZ", "XCDI_Gyro.gyrZ", "a message of mti.dbc: XCDI_SampleTime"),
        ("lpms", 'axes = "y -x z"', 'axes = "y x z"', "a right-handed frame: these axes mirror it"),
        ("lpms", 'axes = "y -x z"', 'axes = "y -x x"', "each of x, y and z once"),
        ("lpms", 'unit = "g"', 'unit = "m/s^2"', "expected g, as the DBC says of ACC_X"),
        ("lpms", 'unit = "g"', 'unit = "furlong"', "one of m/s^2, g, mg"),
        ("lpms", 'counter = "LPMS_1.COUNT"', 'counter = "LPMS_1.COUNTS"', "a signal of LPMS_1"),
        ("mti", 'first = "XCDI_SampleTime"\n', "", "the message that a unit sends first of each sample"),
        ("bno", "IMU{id}_ACCL.X", "IMU1_ACCL.X", "the node's number in the name, written {id}"),
        ("bno", 'world = "ned"', 'world = "y x z"', "a right-handed world"),
        ("lpms", '"ZYX"', '"ZZX"', "no axis twice in a row"),
        ("mti", "gyroscope =", "magnetometer2 =", "no such key"),
    ],
)  # fmt: skip
def test_each_mistake_is_one_line_with_what_to_do(name: str, old: str, new: str, expected: str) -> None:
    lines = wrong(old, new, name)
    assert [line for line in lines if expected in line], lines
    assert f"layout.{name}." in lines[0]


def test_all_mistakes_of_a_layout_are_told_at_once() -> None:
    text = (HERE / "layouts.toml").read_text("utf-8")
    for old, new in (("accX", "ax"), ("gyrY", "gy"), ("magZ", "mz"), ("XCDI_SampleTime.timestamp", "T.t")):
        text = text.replace(old, new, 1)
    section = check_config(HERE / "layouts.toml", tomllib.loads(text), SuitSection)
    with pytest.raises(ConfigError) as error:
        load_layout("mti", section.layout["mti"], [1])
    assert len(error.value.mistakes) == 4


def test_a_unit_without_units_in_its_dbc_must_have_them_written(tmp_path: Path) -> None:
    text = (HERE / "mti.dbc").read_text("utf-8").replace('"rad/s"', '""')
    (tmp_path / "mti.dbc").write_text(text, "utf-8")
    table = tomllib.loads((HERE / "layouts.toml").read_text("utf-8"))
    section = check_config(tmp_path / "layouts.toml", table, SuitSection)
    with pytest.raises(ConfigError, match=r"gyroscope.unit = None: expected one of rad/s, deg/s, mdeg/s"):
        load_layout("mti", section.layout["mti"], [1])


@pytest.mark.parametrize("axes", ["x y z", "y -x z", "-z x -y", "-x -y z", "z -y x"])
def test_a_permutation_is_the_rotation_of_its_quaternion(axes: str) -> None:
    matrix = permutation(axes)
    proper = matrix * np.linalg.det(matrix)
    v = np.array([0.3, -1.0, 2.0])
    assert np.allclose(rotate(quaternion_of(matrix), v), proper @ v)


def test_a_left_handed_unit_turns_by_the_left_hand_rule() -> None:
    """A left-handed unit's y points the other way, and its rates about x and z change their signs."""
    text = (HERE / "layouts.toml").read_text("utf-8")
    text = text.replace('axes = "y -x z"', 'axes = "x -y z"\nhandedness = "left"')
    table = tomllib.loads(text)
    table["layout"]["lpms"].pop("orientation")
    section = check_config(HERE / "layouts.toml", table, SuitSection)
    layout = load_layout("lpms", section.layout["lpms"], [1])
    assert layout.signs.tolist() == [1.0, -1.0, 1.0, -1.0, 1.0, -1.0, 1.0, 1.0, 1.0]
    # what a right-handed sensor sees of gravity as it turns by +ω about x: d(acc)/dt = acc × ω
    acc, rate = np.array([0.0, 0.0, 9.8]), np.array([0.1, 0.0, 0.0])
    turned = rotate(from_axis_angle([1.0, 0.0, 0.0], -0.1), acc)
    unit_acc, unit_turned = acc * layout.signs[:3], turned * layout.signs[:3]
    unit_rate = rate * layout.signs[3:6]
    assert unit_turned[1] - unit_acc[1] < 0.0
    assert unit_rate[0] < 0.0


def test_segments_need_a_node_or_a_word(tmp_path: Path) -> None:
    text = EXAMPLE.read_text("utf-8").replace("../../", f"{EXAMPLE.parents[2]}/")
    text = text.replace('left_little_distal = { id = 22, bus = "suit" }\n', "")
    (tmp_path / "master.toml").write_text(text, "utf-8")
    with pytest.raises(ConfigError, match=r"nodes.left_little_distal.*a word in suit.without_node"):
        load_config(tmp_path / "master.toml", MasterConfig)
    said = text + '\n[suit.without_node]\nleft_little_distal = "parent"\n'
    (tmp_path / "master.toml").write_text(said, "utf-8")
    assert load_config(tmp_path / "master.toml", MasterConfig).suit.without_node
    (tmp_path / "master.toml").write_text(said + 'head = "neutral"\ntail = "parent"\n', "utf-8")
    with pytest.raises(ConfigError) as error:
        load_config(tmp_path / "master.toml", MasterConfig)
    assert [mistake.key for mistake in error.value.mistakes] == [
        "suit.without_node.head", "suit.without_node.tail"
    ]  # fmt: skip


def test_a_master_file_tells_the_mistakes_of_all_its_layouts(tmp_path: Path) -> None:
    text = EXAMPLE.read_text("utf-8").replace("../../", f"{EXAMPLE.parents[2]}/")
    text = text.replace(
        'head = { id = 2, bus = "suit" }', 'head = { id = 2, bus = "suit", layout = "other" }'
    )
    layouts = (HERE / "layouts.toml").read_text("utf-8").replace("[layout.", "[suit.layout.")
    for name in ("mti", "lpms", "bno", "muxed"):
        (tmp_path / f"{name}.dbc").write_bytes((HERE / f"{name}.dbc").read_bytes())
    (tmp_path / "master.toml").write_text(text + layouts, "utf-8")
    with pytest.raises(
        ConfigError, match=r"nodes\.head\.layout = 'other': expected one of the layouts: mti, lpms, bno"
    ):
        load_config(tmp_path / "master.toml", MasterConfig)
    good = text.replace('"other"', '"mti"') + layouts
    (tmp_path / "master.toml").write_text(good.replace("gyrX", "gx").replace("EULER_Y", "E"), "utf-8")
    with pytest.raises(ConfigError) as error:
        load_config(tmp_path / "master.toml", MasterConfig)
    assert {mistake.key.split(".")[2] for mistake in error.value.mistakes} == {"mti", "lpms"}
