"""A node's TOML file: writes what a calibration found, and leaves the rest of the file as it is."""

from __future__ import annotations

import os
import tempfile
import tomllib
from pathlib import Path
from typing import Literal

import numpy as np
import tomlkit
from tomlkit.exceptions import TOMLKitError
from tomlkit.items import Array as TomlArray
from tomlkit.items import Table

from common.config.load import check_config, load_config
from common.config.sensor_calibration import Made, NodeCalibration
from common.errors import ConfigError, ConfigMistake, TandemError
from common.quaternion import Array

Part = Literal["accelerometer", "gyroscope", "magnetometer", "alignment"]
_KEY: dict[Part, str] = {
    "accelerometer": "accelerometer",
    "gyroscope": "gyroscope",
    "magnetometer": "magnetometer",
    "alignment": "q_sensor_from_segment",
}
_DIGITS = 10
"""Significant digits of a number: more than any sensor's."""


def write_calibration(path: Path, parts: dict[Part, tuple[Array, Made]]) -> NodeCalibration:
    """Write parts into a node's file: affine maps (3, 4), or the alignment (4,), each with its `Made`.

    Other parts and comments of an existing file stay. The file is replaced in one step: a reader
    sees the old or the new one. Returns what the file now says.
    Raises ConfigError, before anything is written, when a part or the existing file is not sound, and
    TandemError where it cannot be written.
    """
    document = _existing(path)
    for part, (values, made) in parts.items():
        document[_KEY[part]] = _numbers(values)
        table = _made_table(document)
        table[part] = _table(made)
        if part == "alignment":
            table.pop("mounting", None)  # its name in files of earlier versions
    text = tomlkit.dumps(document)
    checked = check_config(path, tomllib.loads(text), NodeCalibration)
    try:
        _replace(path, text)
    except OSError as error:
        raise TandemError(f"{path}: cannot be written ({error.strerror or error})") from None
    return checked


def _existing(path: Path) -> tomlkit.TOMLDocument:
    if not path.exists():
        return tomlkit.document()
    try:
        return tomlkit.parse(path.read_text("utf-8"))
    except OSError as error:
        raise ConfigError(
            path, [ConfigMistake("file", path.name, f"a readable file ({error.strerror or error})")]
        ) from None
    except (TOMLKitError, UnicodeDecodeError) as error:
        raise ConfigError(path, [ConfigMistake("file", path.name, f"valid TOML ({error})")]) from None


def _made_table(document: tomlkit.TOMLDocument) -> Table:
    if not isinstance(document.get("made"), Table):
        document["made"] = tomlkit.table(is_super_table=True)
    made = document["made"]
    assert isinstance(made, Table)
    return made


def _table(made: Made) -> Table:
    table = tomlkit.table()
    for key, value in made.model_dump(exclude_none=True).items():
        numeric = isinstance(value, list | float)
        table[key] = _numbers(np.asarray(value)) if numeric else value
    return table


def _numbers(values: Array) -> TomlArray | float:
    """A number, a row, or a row a line."""
    if values.ndim == 0:
        return float(f"{float(values):.{_DIGITS}g}")
    array = tomlkit.array()
    array.extend(_numbers(v) for v in values)
    return array.multiline(values.ndim > 1)


def _replace(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    try:
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
        # mkstemp makes it the owner's alone; a calibration may be read by all who may read its folder
        Path(temporary).chmod(0o644)
        Path(temporary).replace(path)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise


def accelerometer_map(folder: Path, name: str) -> Array | None:
    """The accelerometer's map (3, 4) that a calibration wrote to the node's file, None where none did.

    Raises ConfigError for a file that is not sound.
    """
    path = folder / f"{name}.toml"
    if not path.exists():
        return None
    file = load_config(path, NodeCalibration)
    return None if file.made.accelerometer is None else np.array(file.accelerometer)
