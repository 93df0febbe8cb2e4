"""Which recordings go when there are too many. Pure but for `remove`."""

from __future__ import annotations

import logging
import re
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from common.clock import to_s
from common.recording.config import RecordingConfig

log = logging.getLogger(__name__)
WRITTEN = r"\d{8}T\d{6}\.\d{3}Z(-\d+)?\.mcap"
"""How the name of a file goes on after its side's: when it was begun; from the second hour on, its number."""
SEAL = "seal.json"
"""A folder with this file is sealed (`tandem session seal`): nothing in it is ever removed."""


@dataclass(frozen=True, slots=True)
class KeptFile:
    """One recording."""

    path: Path
    size: int
    """Bytes."""
    changed_ns: int
    """When it was last written to, ns since 1970."""


def to_remove(files: Sequence[KeptFile], config: RecordingConfig, now_ns: int) -> list[KeptFile]:
    """The files to remove, oldest first. The newest always stays: it is being written."""
    oldest_first = sorted(files, key=lambda file: file.changed_ns)[:-1]
    total = sum(file.size for file in files)
    gone = []
    for file in oldest_first:
        too_old = config.max_hours is not None and to_s(now_ns - file.changed_ns) > 3600.0 * config.max_hours
        too_much = config.keep_gb is not None and total > config.keep_gb * 1e9
        if too_old or too_much:
            gone.append(file)
            total -= file.size
    return gone


def remove(folder: Path, name: str, config: RecordingConfig, now_ns: int) -> list[Path]:
    """Remove what is too old or too much of the files that NAME's recorder wrote; returns what has gone."""
    if (folder / SEAL).exists():
        return []
    files = []
    # another side may be called NAME-2
    own = re.compile(rf"{re.escape(name)}-{WRITTEN}")
    for path in folder.glob("*.mcap"):
        if not own.fullmatch(path.name):
            continue
        with suppress(OSError):  # it may have been moved meanwhile
            status = path.stat()
            files.append(KeptFile(path, status.st_size, status.st_mtime_ns))
    gone = []
    for file in to_remove(files, config, now_ns):
        try:
            file.path.unlink()
        except OSError as error:
            log.warning("%s: cannot be removed: %s", file.path, error.strerror)
        else:
            log.info("%s: removed, to keep within [recording]", file.path)
            gone.append(file.path)
    return gone
