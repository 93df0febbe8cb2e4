"""The page's files, read once each version, served whole or compressed. Nothing else is served."""

from __future__ import annotations

import gzip
import hashlib
from dataclasses import dataclass
from pathlib import Path

HERE = Path(__file__).parent
FOLDERS = {"page": HERE / "page", "vendor": HERE / "vendor"}
TYPES = {
    ".html": "text/html",
    ".css": "text/css",
    ".js": "text/javascript",
    ".mjs": "text/javascript",
    ".json": "application/json",
    ".svg": "image/svg+xml",
    ".png": "image/png",
    ".ico": "image/x-icon",
    ".woff2": "font/woff2",
    ".txt": "text/plain",
    ".map": "application/json",
}
_COMPRESSED = {".html", ".css", ".js", ".mjs", ".json", ".svg", ".txt", ".map"}


@dataclass(frozen=True, slots=True)
class PageFile:
    """A file as it is sent."""

    content_type: str
    plain: bytes
    gzipped: bytes | None
    """None for what is compressed already."""
    etag: str


class PageFiles:
    """Looks files up by the path in the URL."""

    def __init__(self, folders: dict[str, Path] | None = None) -> None:
        self._folders = folders or FOLDERS
        self._read: dict[Path, tuple[int, PageFile]] = {}

    def find(self, folder: str, name: str) -> PageFile | None:
        """The file; None where there is none of that name, or none of a known kind."""
        root = self._folders.get(folder)
        if root is None:
            return None
        path = (root / name).resolve()
        if not path.is_relative_to(root.resolve()) or path.suffix not in TYPES or not path.is_file():
            return None
        changed_ns = path.stat().st_mtime_ns
        known = self._read.get(path)
        if known is None or known[0] != changed_ns:
            plain = path.read_bytes()
            etag = hashlib.sha256(plain).hexdigest()[:32]
            packed = gzip.compress(plain, 6, mtime=0) if path.suffix in _COMPRESSED else None
            known = changed_ns, PageFile(TYPES[path.suffix], plain, packed, etag)
            self._read[path] = known
        return known[1]
