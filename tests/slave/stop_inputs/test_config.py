"""A mistake in `[estop]` names the key, its value and what was expected."""

from __future__ import annotations

from pathlib import Path

import pytest

from common.config.load import load_config
from common.errors import ConfigError
from slave.config import SlaveConfig
from slave.stop_inputs.config import StopInputConfig

HEAD = 'robot = "robot-1"\n[link]\nlisten = ["tcp/127.0.0.1:7447"]\n'
CANOPEN = '[servos]\nbackend = "canopen"\n[servos.canopen]\ntell_inputs = ["neck_yaw"]\n'


def load(folder: Path, *inputs: str, more: str = "") -> SlaveConfig:
    file = folder / "slave.toml"
    tables = "".join(f"[[estop.inputs]]\n{text}\n" for text in inputs)
    file.write_text(HEAD + more + tables, "utf-8")
    return load_config(file, SlaveConfig)


GPIO = 'name = "red button"\nsource = "gpio"\nline = "STOP"\n'


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('name = "a"\nsource = "gpio"', "estop.inputs.0.line = (not set): expected this key to be set"),
        (GPIO + 'joint = "neck_yaw"', "estop.inputs.0.joint = 'neck_yaw': expected no such key"),
        (GPIO + 'bias = "up"', "estop.inputs.0.bias = 'up': expected 'pull_up', 'pull_down'"),
        (GPIO + 'closed_level = "high"', '"low": with pull_up a broken wire reads high, as if closed'),
        (GPIO + 'bias = "external"', 'closed_level = (not set): expected "low" or "high"'),
        ('name = "a"\nsource = "gpio"\nline = "17"', "estop.inputs.0.chip = (not set): expected the chip's"),
        ('name = "a"\nsource = "usb"', "estop.inputs.0.source = 'usb': expected 'gpio'"),
        (GPIO.replace("red button", "ü" * 40), "at most 64 bytes"),
        ('name = "a"\nsource = "sto"\njoint = "neck_yaw"', "only drives on CANopen"),
        ('name = "a"\nsource = "drive"\nbit = 16\njoint = "neck_yaw"', "only drives on CANopen"),
    ],
)
def test_a_mistake_names_key_value_and_what_was_expected(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(ConfigError) as error:
        load(tmp_path, text)
    assert said in str(error.value)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('name = "a"\nsource = "drive"\njoint = "neck_yaw"', "estop.inputs.0.bit = (not set)"),
        ('name = "a"\nsource = "drive"\nbit = 32\njoint = "neck_yaw"', "estop.inputs.0.bit = 32"),
        ('name = "a"\nsource = "drive"\nbit = 0\njoint = "neck"', "a joint of the profile"),
        ('name = "a"\nsource = "drive"\nbit = 0\njoint = "neck_pitch"', "servos.canopen.tell_inputs"),
        (
            'name = "a"\nsource = "sto"\njoint = "neck_yaw"\nnormally_closed = false',
            "a drive tells by itself whether it has torque",
        ),
    ],
)
def test_a_mistake_about_a_drive_is_named_too(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(ConfigError) as error:
        load(tmp_path, text, more=CANOPEN)
    assert said in str(error.value)


def test_a_joint_that_shall_tell_its_inputs_is_one_of_the_robot(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="tell_inputs = 'tail'"):
        load(tmp_path, more=CANOPEN.replace("neck_yaw", "tail"))


def test_one_line_cannot_be_two_inputs_nor_two_inputs_have_one_name(tmp_path: Path) -> None:
    with pytest.raises(ConfigError) as error:
        load(tmp_path, GPIO, GPIO)
    assert "a name that no other input has" in str(error.value)
    with pytest.raises(ConfigError, match="does not read already"):
        load(tmp_path, GPIO, GPIO.replace("red button", "blue button"))


def test_good_inputs_are_taken(tmp_path: Path) -> None:
    config = load(
        tmp_path, GPIO,
        'name = "case"\nsource = "drive"\njoint = "neck_yaw"\nbit = 0',
        'name = "relay"\nsource = "sto"\njoint = "neck_yaw"', more=CANOPEN,
    )  # fmt: skip
    assert [one.where for one in config.estop.inputs] == [
        "gpio line STOP", "input bit 0 of the drive of neck_yaw", "safe torque off of the drive of neck_yaw",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("keys", "on"),
    [
        ({"source": "gpio", "line": "A"}, False),  # pulled up: a closed contact to ground reads low
        ({"source": "gpio", "line": "A", "bias": "pull_down"}, True),
        ({"source": "gpio", "line": "A", "bias": "external", "closed_level": "high"}, True),
        ({"source": "gpio", "line": "A", "normally_closed": False}, True),
        ({"source": "drive", "joint": "a", "bit": 3}, True),
        ({"source": "drive", "joint": "a", "bit": 31, "closed_level": "low"}, False),  # "STO active"
        ({"source": "device", "device": "d", "key": "KEY_B"}, True),
        ({"source": "sto", "joint": "a"}, True),
    ],
)
def test_the_level_at_rest_follows_from_the_wiring(keys: dict[str, object], on: bool) -> None:
    assert StopInputConfig.model_validate({"name": "a", **keys}).on_at_rest is on
