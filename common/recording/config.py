"""`[recording]`: where the recorder beside this process writes, and how much it keeps."""

from __future__ import annotations

from pathlib import Path

from pydantic import Field

from common.config.section import RelativePath, Section
from common.errors import ConfigMistake


class RecordingConfig(Section):
    """`[recording]`. Only `tandem record --config FILE` follows it, in a process of its own."""

    folder: RelativePath | None = None
    """An existing folder for the files; None: nothing is recorded."""
    minutes_per_file: float = Field(default=60.0, ge=1.0, le=240.0)
    """A new file begins after this time. The index of an open file takes 15 MB an hour."""
    keep_gb: float | None = Field(default=None, gt=0.0)
    """The oldest files are removed while all together are larger; None: however large."""
    max_hours: float | None = Field(default=None, gt=0.0)
    """Files that ended longer ago are removed; None: however old."""

    def mistakes_with(self, socket: Path | None) -> list[ConfigMistake]:
        """There is a tap to record at. The folder is the recorder's business: a robot runs without it."""
        if self.folder is not None and socket is None:
            return [ConfigMistake("tap.socket", None, "a path, since [recording] folder is set")]
        return []
