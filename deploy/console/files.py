"""The page's files, read once each version, served whole or compressed. Nothing else is served."""

from __future__ import annotations

import gzip
import hashlib
import re
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
_PART = re.compile(rb"<!-- part of (\S+): page=(\w+) modules=([\w,]*) vendor=([\w,]*) -->\n")
"""The first line of a page that is shown in the shell: banner, stop and keys are the same on each."""
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
        changed_ns = max(each.stat().st_mtime_ns for each in (path, *path.parent.glob("shell.html")))
        known = self._read.get(path)
        if known is None or known[0] != changed_ns:
            plain = _whole(path)
            etag = hashlib.sha256(plain).hexdigest()[:32]
            packed = gzip.compress(plain, 6, mtime=0) if path.suffix in _COMPRESSED else None
            known = changed_ns, PageFile(TYPES[path.suffix], plain, packed, etag)
            self._read[path] = known
        return known[1]


def _whole(path: Path) -> bytes:
    """A file's bytes; of a part, within its shell."""
    plain = path.read_bytes()
    found = _PART.match(plain)
    if found is None:
        return plain
    shell, page, modules, vendor = (group.decode() for group in found.groups())
    named = {"page": modules, "vendor": vendor}
    wanted = [(folder, name) for folder, names in named.items() for name in names.split(",")]
    preload = "\n".join(
        f'<link rel="modulepreload" href="/{folder}/{name}.js">' for folder, name in wanted if name
    )
    text = (path.parent / shell).read_text("utf-8").replace("{page}", page).replace("{preload}", preload)
    return text.replace("{main}", plain[found.end() :].decode()).encode()
