"""TOML files into checked models; a mistake names file, key, value and what was expected."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError

from common.errors import ConfigError, ConfigMistake


class Section(BaseModel):
    """Base of every part of a configuration: frozen, strict, unknown keys are mistakes."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)


class LinkConfig(Section):
    """`[link]`: Zenoh endpoints, such as `tcp/192.168.7.2:7447`, `udp/…`, `ws/…`, `unixsock-stream/…`."""

    listen: list[str] = []
    connect: list[str] = []


Model = TypeVar("Model", bound=Section)


def load_config(path: Path, model: type[Model]) -> Model:
    """Read and check a TOML file before anything is opened. Raises ConfigError, one line a mistake."""
    try:
        text = path.read_text("utf-8")
    except OSError as error:
        raise ConfigError(
            path, [ConfigMistake("file", str(path), f"a readable file ({error.strerror})")]
        ) from None
    try:
        table = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ConfigError(path, [ConfigMistake("file", path.name, f"valid TOML ({error})")]) from None
    return check_config(path, table, model)


def check_config(path: Path, table: dict[str, Any], model: type[Model]) -> Model:
    """The checked model of a table that was read from `path`."""
    try:
        # TOML has no tuples and its integers serve as floats: lax there, strict in the rest
        return model.model_validate(table)
    except ValidationError as error:
        mistakes = [
            ConfigMistake(".".join(map(str, e["loc"])) or "file", e["input"], _expected(e["type"], e["msg"]))
            for e in error.errors()
        ]
        raise ConfigError(path, mistakes) from None


def _expected(kind: str, message: str) -> str:
    if kind == "extra_forbidden":
        return "no such key (is it misspelt?)"
    if kind == "missing":
        return "this key to be set"
    for lead in ("Input should be ", "Value error, expected ", "Value error, "):
        message = message.removeprefix(lead)
    return message
