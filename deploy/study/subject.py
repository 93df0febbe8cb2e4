"""Everything of one subject: handed out as a zip file, or deleted with a receipt."""

from __future__ import annotations

import json
import shutil
import zipfile
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path

from common.clock import NS_PER_S, Clock, wall_ns
from common.errors import TandemError
from deploy.study.protocol import check_code
from deploy.study.seal import SEAL

RECEIPTS = "deletions.jsonl"


@dataclass(frozen=True, slots=True)
class Deletion:
    """What was deleted, without anything of its content."""

    subject: str
    when: str
    files: int
    size: int
    """Bytes."""
    heads: tuple[str, ...]
    """Of the seals that the sessions had."""


def export_subject(root: Path, subject: str, out: Path) -> int:
    """Write all files of a subject into a new zip file; how many. Raises TandemError."""
    folder = _folder(root, subject)
    files = _files(folder)
    try:
        with zipfile.ZipFile(out, "x", zipfile.ZIP_DEFLATED) as archive:
            for path in files:
                archive.write(path, path.relative_to(root))
    except FileExistsError:
        raise TandemError(f"{out}: is there already; name another file, or move it away") from None
    except OSError as error:
        raise TandemError(f"{out}: cannot be written ({error.strerror or error})") from None
    return len(files)


def delete_subject(root: Path, subject: str, wall: Clock = wall_ns) -> Deletion:
    """Delete all files of a subject; the receipt is added to `deletions.jsonl`. Raises TandemError.

    Copies elsewhere, and the row in the table of names, are not touched.
    """
    folder = _folder(root, subject)
    files = _files(folder)
    heads = tuple(str(json.loads(path.read_text("utf-8"))["head"]) for path in files if path.name == SEAL)
    when = datetime.fromtimestamp(wall() / NS_PER_S, UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
    receipt = Deletion(subject, when, len(files), sum(path.stat().st_size for path in files), heads)
    try:
        shutil.rmtree(folder)
        with (root / RECEIPTS).open("a", encoding="utf-8") as stream:
            stream.write(json.dumps(asdict(receipt)) + "\n")
    except OSError as error:
        raise TandemError(f"{folder}: not all of it could be deleted ({error.strerror or error})") from None
    return receipt


def _folder(root: Path, subject: str) -> Path:
    folder = root / f"sub-{check_code('--subject', subject)}"
    if not folder.is_dir():
        raise TandemError(f"{folder}: there is no such subject")
    return folder


def _files(folder: Path) -> Sequence[Path]:
    return sorted(path for path in folder.rglob("*") if path.is_file())
