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
PARTICIPANTS = "participants.tsv"
"""`tandem export --to bids` writes it, where it writes into the study's folder."""


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
    """Write all files of a subject into a new zip file; how many.

    Raises TandemError, also where the file would lie in the study's folder: `delete_subject` would leave it.
    """
    folder = _folder(root, subject)
    if out.resolve().is_relative_to(root.resolve()):
        raise TandemError(
            f"{out}: it would lie in the study's folder {root.resolve()}; name one outside of it"
        )
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
    """Delete all files of a subject, and its row of a BIDS table of participants. Raises TandemError.

    The receipt is added to `deletions.jsonl`. Copies elsewhere, and the row in the table of names, are not
    touched.
    """
    folder = _folder(root, subject)
    files = _files(folder)
    heads = tuple(head for path in files if path.name == SEAL if (head := _head(path)))
    when = datetime.fromtimestamp(wall() / NS_PER_S, UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
    receipt = Deletion(subject, when, len(files), sum(path.stat().st_size for path in files), heads)
    try:
        shutil.rmtree(folder)
        _leave_out(root / PARTICIPANTS, f"sub-{subject}")
    except OSError as error:
        raise TandemError(f"{folder}: not all of it could be deleted ({error.strerror or error})") from None
    try:
        with (root / RECEIPTS).open("a", encoding="utf-8") as stream:
            stream.write(json.dumps(asdict(receipt)) + "\n")
    except OSError as error:
        raise TandemError(
            f"{folder}: it is deleted, but {root / RECEIPTS} takes no receipt ({error.strerror or error})"
        ) from None
    return receipt


def _head(seal: Path) -> str:
    """Of a seal; empty where it is damaged, which must not keep its folder from being deleted."""
    try:
        return str(json.loads(seal.read_text("utf-8"))["head"])
    except (OSError, ValueError, KeyError, TypeError):
        return ""


def _leave_out(table: Path, row: str) -> None:
    """Write a table again without the row of a name."""
    if not table.exists():
        return
    lines = table.read_text("utf-8").splitlines(keepends=True)
    kept = [line for line in lines if line.split("\t")[0].strip() != row]
    if kept != lines:
        table.write_text("".join(kept), "utf-8")


def _folder(root: Path, subject: str) -> Path:
    folder = root / f"sub-{check_code('--subject', subject)}"
    if not folder.is_dir():
        raise TandemError(f"{folder}: there is no such subject")
    return folder


def _files(folder: Path) -> Sequence[Path]:
    return sorted(path for path in folder.rglob("*") if path.is_file())
