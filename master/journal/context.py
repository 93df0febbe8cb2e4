"""What a recording must say so that it can be computed again: the configuration, its files, the versions.

Keys, endpoints and access rules are left out: the pipeline does not read them, and they are not to be shared.
"""

from __future__ import annotations

import json
import platform
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from common.config.section import Section
from common.wire.version import software

CONFIG, FILES = "master_config", "master_files"
_NOT_READ = {"link", "tap", "process", "alarms"}
"""Sections that the pipeline does not read."""
ENCODING = "latin-1"
"""Each byte is one character: a DBC file may be in any encoding."""


def describe(config: Section, robots: Sequence[str]) -> dict[str, str]:
    """The metadata of a recording of a master with this configuration, which commands these robots.

    Raises OSError where a file that it names has gone.
    """
    files: dict[str, str] = {}
    table = _embedded(config.model_dump(exclude=_NOT_READ), files)
    return {
        "role": "master",
        "robots": " ".join(robots),
        "tandem": software().tandem,
        "numpy": np.__version__,
        "machine": f"{platform.machine()} {platform.system()}",
        CONFIG: json.dumps(table),
        FILES: json.dumps(files),
    }


def _embedded(value: object, files: dict[str, str]) -> object:
    """The value with each path replaced by the name under which its file's content stands in `files`."""
    if isinstance(value, Path):
        name = f"{len(files)}{value.suffix}"
        files[name] = value.read_bytes().decode(ENCODING)
        return name
    if isinstance(value, Mapping):
        return {key: _embedded(part, files) for key, part in value.items()}
    if isinstance(value, list | tuple):
        return [_embedded(part, files) for part in value]
    return value
