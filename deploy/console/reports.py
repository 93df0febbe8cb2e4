"""Reports that lie on this host, for the page to open: of trials, soaks, benches and recordings."""

from __future__ import annotations

import logging
import os
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

REPORT_TYPES = {
    ".html": "text/html", ".png": "image/png", ".svg": "image/svg+xml", ".css": "text/css",
    ".json": "application/json", ".csv": "text/csv", ".md": "text/plain", ".txt": "text/plain",
    ".toml": "text/plain",
}  # fmt: skip
LISTED = (".html", ".md")
"""What is a report by itself; the others are its parts."""
DEEPEST, MOST = 4, 200
MOST_SEEN = 20_000
"""Files and folders that are looked at; what lies behind them is not listed."""
POLICY = (
    "default-src 'none'; img-src 'self' data:; style-src 'self' 'unsafe-inline'; frame-ancestors 'none'; "
    "sandbox allow-same-origin"
)
"""A report runs no script, whoever wrote it. It keeps its origin: another one would be refused its pictures,
and would send no cookie for them."""

log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class ReportFile:
    """A file as it is sent."""

    content_type: str
    body: bytes


@dataclass(frozen=True, slots=True)
class ReportFolder:
    """`[console] reports`; None: there are none."""

    root: Path | None = None

    def listed(self) -> list[dict[str, str]]:
        """Name, path and date of each, newest first. Walks the disk: not for the event loop."""
        if self.root is None:
            return []
        reports = [(changed_s, path) for path, changed_s in self._walk(self.root) if self._inside(path)]
        newest = sorted(reports, reverse=True)[:MOST]
        return [self._line(self.root, path, changed_s) for changed_s, path in newest]

    def find(self, name: str) -> ReportFile | None:
        """A report, or a part of one; None where there is none of that name, or of no known kind."""
        if self.root is None:
            return None
        path = self.root / name
        kind = REPORT_TYPES.get(path.suffix)
        if kind is None or not self._inside(path) or not path.is_file():
            return None
        try:
            return ReportFile(kind, path.read_bytes())
        except OSError:
            return None

    @staticmethod
    def _walk(root: Path) -> Iterator[tuple[Path, float]]:
        """Reports with their time of change, s, folder by folder; those near the root first."""
        folders = deque([(root, 1)])
        seen = 0
        while folders:
            folder, depth = folders.popleft()
            try:
                with os.scandir(folder) as entries:
                    for entry in entries:
                        seen += 1
                        if seen > MOST_SEEN:
                            log.warning("%s: more than %d files; not all reports are listed", root, MOST_SEEN)
                            return
                        if entry.is_dir() and depth < DEEPEST:
                            folders.append((Path(entry.path), depth + 1))
                        elif entry.name.endswith(LISTED) and entry.is_file():
                            yield Path(entry.path), entry.stat().st_mtime
            except OSError:
                continue  # gone meanwhile, or not ours to read

    def _inside(self, path: Path) -> bool:
        """Whether it lies in the folder, links followed."""
        return self.root is not None and path.resolve().is_relative_to(self.root.resolve())

    @staticmethod
    def _line(root: Path, path: Path, changed_s: float) -> dict[str, str]:
        changed = datetime.fromtimestamp(changed_s, UTC)
        name = path.relative_to(root).as_posix()
        return {"name": name, "path": f"/reports/{name}", "words": changed.strftime("%Y-%m-%d %H:%M UTC")}
