"""`[operator.deadman]` and `[operator.clutch]`: what can be written, and what is refused in which words."""

from __future__ import annotations

from pathlib import Path

import pytest

from common.config.load import load_config
from common.errors import ConfigError
from master.config import MasterConfig, OperatorConfig
from master.deadman.config import AlwaysHeld, CanButton, Pedal

EXAMPLE = Path(__file__).parents[3] / "deploy" / "examples" / "master.toml"
PEDAL = 'operator.deadman={source="pedal",device="FootSwitch",key="KEY_B"}'
BUTTON = 'operator.deadman={source="can",bus="suit",signal="DEADMAN"}'


def operator(*overrides: str) -> OperatorConfig:
    return load_config(EXAMPLE, MasterConfig, overrides).operator


def test_each_source_can_be_written() -> None:
    assert operator().deadman == AlwaysHeld(source="always_held")
    assert operator().clutch is None
    clutched = operator(PEDAL, 'operator.clutch={source="pedal",device="FootSwitch",key="BTN_TRIGGER"}')
    assert clutched.deadman == Pedal(source="pedal", device="FootSwitch", key="KEY_B")
    assert clutched.clutch == Pedal(source="pedal", device="FootSwitch", key="BTN_TRIGGER")
    assert operator(BUTTON).deadman == CanButton(source="can", bus="suit", signal="DEADMAN")


@pytest.mark.parametrize(
    ("overrides", "words"),
    [
        (['operator.deadman="always_held"'], r"operator\.deadman = 'always_held': expected its new form: "),
        (
            ['operator.deadman.source="console"'],
            r"operator\.deadman\.socket = \(not set\)",
        ),
        (
            ['operator.deadman={source="console",socket="/nowhere/deadman.sock"}'],
            r"operator\.deadman\.socket = .*a path in a folder that exists",
        ),
        (
            [f'operator.deadman={{source="console",socket="/tmp/{"x" * 100}"}}'],
            r"operator\.deadman\.socket = .*a path of at most 100 bytes",
        ),
        (
            ['operator.deadman.source="wish"'],
            r"operator\.deadman\.source = 'wish': expected 'always_held', 'pedal', 'can'",
        ),
        (["operator.deadman={}"], r"operator\.deadman\.source = \(not set\): expected this key"),
        ([PEDAL, "operator.deadman.key=3"], r"operator\.deadman\.key = 3: "),
        ([PEDAL, 'operator.deadman.key="b"'], r"operator\.deadman\.key = 'b': "),
        ([PEDAL, 'operator.deadman.bus="suit"'], r"operator\.deadman\.bus = 'suit': expected no such key"),
        (['operator.deadman={source="pedal"}'], r"operator\.deadman\.device = \(not set\)"),
        ([BUTTON, 'operator.deadman.bus="leg"'], r"operator\.deadman\.bus = 'leg': .*suit"),
        ([BUTTON, "operator.deadman.timeout_s=0.0"], r"operator\.deadman\.timeout_s = 0\.0"),
        (['operator.clutch={source="always_held"}'], r"operator\.clutch\.source = 'always_held': expected"),
        ([PEDAL, PEDAL.replace("deadman", "clutch")], r"operator\.clutch\.key = 'KEY_B': expected another"),
        ([BUTTON, BUTTON.replace("deadman", "clutch")], r"operator\.clutch\.signal = 'DEADMAN'"),
    ],
)
def test_what_is_refused(overrides: list[str], words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        operator(*overrides)
