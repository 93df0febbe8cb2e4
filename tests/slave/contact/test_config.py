"""`[contact]` as a site writes it into the slave's file."""

from __future__ import annotations

from pathlib import Path

import pytest

from common.config.load import load_config
from common.errors import ConfigError
from slave.config import SlaveConfig
from slave.contact.config import Reflex


def loaded(folder: Path, contact: str) -> SlaveConfig:
    file = folder / "slave.toml"
    file.write_text(
        f'robot = "robot-1"\n[link]\nlisten = ["tcp/127.0.0.1:7447"]\n[contact]\n{contact}\n', "utf-8"
    )
    return load_config(file, SlaveConfig)


@pytest.mark.parametrize("reflex", Reflex)
def test_a_file_names_the_reflex(tmp_path: Path, reflex: Reflex) -> None:
    assert loaded(tmp_path, f'reflex = "{reflex}"').contact.reflex is reflex


@pytest.mark.parametrize(
    ("contact", "said"),
    [
        ('reflex = "hlod"', r"contact\.reflex = 'hlod': expected 'hold', 'retreat' or 'float'"),
        ("model_error = nan", r"contact\.model_error = nan: expected a finite number"),
        ("joints.tail.threshold_nm = 1.0", r"contact\.joints\.tail = 'tail': expected a joint"),
    ],
)
def test_a_mistake_is_named(tmp_path: Path, contact: str, said: str) -> None:
    with pytest.raises(ConfigError, match=said):
        loaded(tmp_path, contact)
