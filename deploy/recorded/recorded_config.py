"""The configuration of a master as its recording holds it."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

from pydantic import ValidationError

from common.config.load import Model, override
from common.errors import RecordingError
from master.config import MasterConfig
from master.journal.context import CONFIG, ENCODING, FILES


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
    with config_of(MasterConfig, name, (table, files), metadata.get("tandem", ""), overrides) as config:
        yield config


@contextmanager
def config_of(
    kind: type[Model],
    name: str,
    held: tuple[dict[str, object], Mapping[str, object]],
    version: str,
    overrides: Sequence[str] = (),
) -> Iterator[Model]:
    """A configuration from its table and the contents of its files, which lie in a folder meanwhile.

    `name`: of the recording, for errors; `version`: of the tandem that wrote it. Raises RecordingError.
    """
    table, files = held
    with TemporaryDirectory(prefix="tandem-replay-") as folder:
        try:
            for file, content in files.items():
                (Path(folder) / Path(file).name).write_bytes(str(content).encode(ENCODING))
            for change in overrides:
                override(table, change)
            text = json.dumps({**table, "link": {}})
            config = kind.model_validate_json(text, context={"folder": Path(folder)})
        except (ValidationError, TypeError, AttributeError) as error:
            raise RecordingError(
                f"{name}: this version does not know its configuration: {error}; compute it with tandem "
                f"{version}, or name one by --config"
            ) from None
        yield config
