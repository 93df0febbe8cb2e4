"""What a recording must say so that it can be computed again: the configuration, its files, the versions.

Keys, endpoints and access rules are left out: the pipeline does not read them, and they are not to be shared.
"""

from __future__ import annotations

import json
import platform
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from pydantic import ValidationError

from common.config.load import override
from common.errors import RecordingError
from common.wire.version import software
from master.config import MasterConfig

CONFIG, FILES = "master_config", "master_files"
_NOT_READ = {"link", "tap", "process", "alarms"}
"""Sections that the pipeline does not read."""
_LATIN = "latin-1"
"""Each byte is one character: a DBC file may be in any encoding."""


def describe(config: MasterConfig) -> dict[str, str]:
    """The metadata of a recording of this master. Raises OSError where a file that it names has gone."""
    files: dict[str, str] = {}
    table = _embedded(config.model_dump(exclude=_NOT_READ), files)
    return {
        "role": "master",
        "robots": " ".join(config.commanded),
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
        files[name] = value.read_bytes().decode(_LATIN)
        return name
    if isinstance(value, Mapping):
        return {key: _embedded(part, files) for key, part in value.items()}
    if isinstance(value, list | tuple):
        return [_embedded(part, files) for part in value]
    return value


@contextmanager
def recorded_config(
    metadata: Mapping[str, str], name: str, overrides: Sequence[str] = ()
) -> Iterator[MasterConfig]:
    """The configuration of a recording; its files lie in a temporary folder meanwhile.

    `name`: of the recording, for errors. `overrides`: as of a file. Raises RecordingError, ConfigError.
    """
    try:
        table, files = json.loads(metadata[CONFIG]), json.loads(metadata[FILES])
    except (KeyError, ValueError):
        raise RecordingError(
            f"{name}: it does not hold the master's configuration: only what `tandem record --tap` or "
            "[recording] of a master wrote can be computed again"
        ) from None
    with TemporaryDirectory(prefix="tandem-replay-") as folder:
        try:
            for file, content in files.items():
                (Path(folder) / Path(file).name).write_bytes(str(content).encode(_LATIN))
            for change in overrides:
                override(table, change)
            text = json.dumps({**table, "link": {}})
            config = MasterConfig.model_validate_json(text, context={"folder": Path(folder)})
        except (ValidationError, TypeError, AttributeError) as error:
            raise RecordingError(
                f"{name}: this version does not know its configuration: {error}; compute it with tandem "
                f"{metadata.get('tandem', '')}, or name one by --config"
            ) from None
        yield config
