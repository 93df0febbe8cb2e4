"""Reports that lie on this host, for the page to open: of trials, soaks, benches and recordings."""

from __future__ import annotations

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
POLICY = (
    "default-src 'none'; img-src 'self' data:; style-src 'self' 'unsafe-inline'; frame-ancestors 'none'; "
    "sandbox allow-same-origin"
)
"""A report runs no script, whoever wrote it. It keeps its origin: another one would be refused its pictures,
and would send no cookie for them."""


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
        """Name, path and date of each, newest first."""
        if self.root is None:
            return []
        found = [path for depth in range(DEEPEST) for path in self.root.glob("/".join(["*"] * (depth + 1)))]
        reports = [path for path in found if path.suffix in LISTED and path.is_file() and self._inside(path)]
        newest = sorted(reports, key=lambda path: -path.stat().st_mtime)[:MOST]
        return [self._line(self.root, path) for path in newest]

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

    def _inside(self, path: Path) -> bool:
        """Whether it lies in the folder, links followed."""
        return self.root is not None and path.resolve().is_relative_to(self.root.resolve())

    @staticmethod
    def _line(root: Path, path: Path) -> dict[str, str]:
        changed = datetime.fromtimestamp(path.stat().st_mtime, UTC)
        name = path.relative_to(root).as_posix()
        return {"name": name, "path": f"/reports/{name}", "words": changed.strftime("%Y-%m-%d %H:%M UTC")}
