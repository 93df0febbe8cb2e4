"""What a recording must say so that it can be computed again: the configuration, its files, the versions.

Keys, endpoints and access rules are left out: the pipeline does not read them, and they are not to be shared.
"""

from __future__ import annotations

import json
import platform
from collections.abc import Mapping
from pathlib import Path
from typing import Protocol

import numpy as np
import tomlkit

from common.skeleton.load import own_profile
from common.wire.version import software

CONFIG, FILES = "master_config", "master_files"
_NOT_READ = {"link", "tap", "recording", "process", "alarms", "console"}
"""Sections that the pipeline does not read."""
SOCKET = "socket"
"""The key of a socket's path, in any section."""
ENCODING = "latin-1"
"""Each byte is one character: a DBC file may be in any encoding."""


class _Config(Protocol):
    """The part of a master's configuration that is read here."""

    @property
    def profile(self) -> str:
        """A name, or the path of one's own."""

    @property
    def commanded(self) -> list[str]:
        """The robots' names."""

    def model_dump(self, *, exclude: set[str]) -> dict[str, object]:
        """As plain values."""


def describe(config: _Config) -> dict[str, str]:
    """The metadata of a recording of a master with this configuration.

    Raises OSError where a file that it names has gone.
    """
    table, files = embedded(config.profile, config.model_dump(exclude=_NOT_READ))
    return {
        "role": "master",
        "robots": " ".join(config.commanded),
        "tandem": software().tandem,
        "numpy": np.__version__,
        "machine": f"{platform.machine()} {platform.system()}",
        CONFIG: table,
        FILES: files,
    }


def embedded(profile: str, sections: Mapping[str, object]) -> tuple[str, str]:
    """A configuration of either side as JSON, and the content of the files that it names, as JSON too.

    `profile`: its robot's, by name or path. Raises OSError where a file has gone.
    """
    files: dict[str, str] = {}
    table = _embedded({**sections, "profile": _profile(profile, files)}, files)
    return json.dumps(table), json.dumps(files)


def _profile(name: str, files: dict[str, str]) -> object:
    """The name of a profile that ships; else that of its file, embedded with the model that it names."""
    path = own_profile(name)
    if path is None:
        return name
    profile = tomlkit.parse(path.read_text("utf-8"))
    if "model" in profile:
        profile["model"] = _embedded(path.parent / str(profile["model"]), files)
    embedded = f"{len(files)}.toml"
    files[embedded] = tomlkit.dumps(profile).encode().decode(ENCODING)
    return embedded


def _embedded(value: object, files: dict[str, str]) -> object:
    """The value with each path replaced by the name under which its file's content stands in `files`."""
    if isinstance(value, Path):
        name = f"{len(files)}{value.suffix}"
        files[name] = value.read_bytes().decode(ENCODING)
        return name
    if isinstance(value, Mapping):
        # a socket has no content, and the pipeline does not read it
        return {key: str(part) if key == SOCKET else _embedded(part, files) for key, part in value.items()}
    if isinstance(value, list | tuple):
        return [_embedded(part, files) for part in value]
    return value
