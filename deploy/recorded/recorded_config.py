"""The configuration of a master as its recording holds it."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

from pydantic import ValidationError

from common.config.load import override
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
    with TemporaryDirectory(prefix="tandem-replay-") as folder:
        try:
            for file, content in files.items():
                (Path(folder) / Path(file).name).write_bytes(str(content).encode(ENCODING))
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
