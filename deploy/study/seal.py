"""A seal over a folder: a chain of SHA-256 over its files. It names the file and the part that was changed.

    h₀ = SHA-256("tandem seal 1 " ‖ time);   hₖ = SHA-256(hₖ₋₁ ‖ name ‖ 0 ‖ size ‖ 0 ‖ the blocks)

The last h, the head, stands for everything. Whoever can write the folder can seal it anew, so the head is to
be kept elsewhere too: on paper, or by the other side.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path

from common.clock import NS_PER_S, Clock, wall_ns
from common.errors import TandemError
from deploy.study.blocks import Block, blocks_of
from deploy.study.signature import sign, signer_of

SEAL = "seal.json"
VERSION = 1
_FIRST = "tandem seal 1 "


@dataclass(frozen=True, slots=True)
class SealedFile:
    """One file as it was sealed."""

    name: str
    """Relative to the folder, with slashes."""
    size: int
    blocks: tuple[Block, ...]


@dataclass(frozen=True, slots=True)
class SealBroken:
    """One thing that is not as it was sealed."""

    name: str
    words: str
    offset: int | None = None
    """Where the changed part begins."""
    length: int | None = None


def seal(folder: Path, wall: Clock = wall_ns, key: Path | None = None) -> str:
    """Write the seal, signed where a `key` is given; returns its head.

    Raises TandemError where there is one already, nothing to seal, a link, or a key that cannot sign.
    """
    if (folder / SEAL).exists():
        raise TandemError(f"{folder}: it is sealed already; `tandem session verify {folder}`")
    files = tuple(_sealed(folder, name) for name in _names(folder))
    if not files:
        raise TandemError(f"{folder}: there are no files to seal")
    sealed = datetime.fromtimestamp(wall() / NS_PER_S, UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
    head = head_of(sealed, files)
    tree: dict[str, object] = {"version": VERSION, "sealed": sealed, "head": head}
    if key is not None:
        tree["signature"], tree["certificate"] = sign(head, key)
    tree["files"] = [asdict(file) for file in files]
    (folder / SEAL).write_text(json.dumps(tree, indent=1) + "\n", "utf-8")
    return head


def _sealed(folder: Path, name: str) -> SealedFile:
    path = folder / name
    if path.is_symlink():
        raise TandemError(f"{path}: it is a link, and a seal is over files: copy here what it leads to")
    return SealedFile(name, path.stat().st_size, tuple(blocks_of(path)))


def head_of(sealed: str, files: Sequence[SealedFile]) -> str:
    """The last hash of the chain; `sealed`: when, as it is written."""
    value = hashlib.sha256((_FIRST + sealed).encode()).digest()
    for file in files:
        digests = "".join(
            f"{block.offset} {block.length} {block.sha256} {block.times_ns} " for block in file.blocks
        )
        told = f"{file.name}\0{file.size}\0{digests}".encode(errors="surrogateescape")
        value = hashlib.sha256(value + told).digest()
    return value.hex()


def verify(
    folder: Path, head: str | None = None, signed: bool = False, by: str | None = None
) -> tuple[str, list[SealBroken]]:
    """The seal's head, and all that is not as it was sealed; empty where everything is.

    `head`: as it was noted elsewhere when it was sealed. `signed`: a signature is expected, so that a seal
    whose signature was taken away fails; `by`: the name in its certificate. Raises TandemError without a
    seal that can be read.
    """
    sealed_at, files, written = _read(folder)
    broken = []
    signed_by = signer(folder)
    if not signed_by and signed_by is not None and (signed or by is not None):
        broken.append(SealBroken(SEAL, "unsigned, and a signature is expected"))
    elif by is not None and signed_by not in (None, by):
        broken.append(SealBroken(SEAL, f"signed by {signed_by}, and {by} is expected"))
    if signed_by is None:
        broken.append(SealBroken(SEAL, "its signature is not of this head, or of another certificate"))
    if head_of(sealed_at, files) != written:
        broken.append(SealBroken(SEAL, "the seal was changed: its time and files do not give its head"))
    if head is not None and head != written:
        broken.append(SealBroken(SEAL, f"it is another seal: its head is {written}, not {head}"))
    sealed = {file.name: file for file in files}
    names = _names(folder)
    broken += [SealBroken(name, "was added after sealing") for name in names if name not in sealed]
    for name, file in sealed.items():
        if name not in names:
            broken.append(SealBroken(name, "is missing"))
        else:
            broken += _compare(folder / name, file)
    return written, broken


def signer(folder: Path) -> str | None:
    """Who signed the seal, by the certificate in it; empty where it is not signed, None where it is forged.

    The certificate is the seal's own: whether it is to be trusted is for whoever knows its authority.
    """
    tree = _tree(folder)
    if "signature" not in tree:
        return ""
    return signer_of(str(tree.get("head")), str(tree["signature"]), str(tree.get("certificate")))


def _compare(path: Path, file: SealedFile) -> list[SealBroken]:
    if path.is_symlink():
        return [SealBroken(file.name, "is a link now, and was a file")]
    size, found = path.stat().st_size, []
    if size != file.size:
        found.append(SealBroken(file.name, f"has {size} bytes, was sealed with {file.size}"))
    with path.open("rb") as stream:
        for block in file.blocks:
            stream.seek(block.offset)
            if hashlib.sha256(stream.read(block.length)).hexdigest() != block.sha256:
                words = f"bytes {block.offset} to {block.offset + block.length - 1} were changed"
                if block.times_ns is not None:
                    words += f" (a chunk of messages, {_span(block.times_ns)})"
                found.append(SealBroken(file.name, words, block.offset, block.length))
    return found


def _span(times_ns: tuple[int, int]) -> str:
    first, last = (datetime.fromtimestamp(t / NS_PER_S, UTC).strftime("%H:%M:%S.%f")[:-3] for t in times_ns)
    return f"{first} to {last} UTC"


def _names(folder: Path) -> list[str]:
    """All files but the seal itself, by name: hidden ones and links too."""
    return sorted(
        path.relative_to(folder).as_posix()
        for path in folder.rglob("*")
        if (path.is_file() or path.is_symlink()) and path != folder / SEAL
    )


def _read(folder: Path) -> tuple[str, list[SealedFile], str]:
    """When it was sealed, the files, and the head."""
    tree = _tree(folder)
    try:
        return str(tree["sealed"]), [_file(file) for file in _list(tree["files"])], str(tree["head"])
    except (ValueError, KeyError, TypeError) as error:
        raise TandemError(f"{folder / SEAL}: cannot be read as a seal ({error})") from None


def _list(value: object) -> list[dict[str, object]]:
    if not isinstance(value, list) or not all(isinstance(one, dict) for one in value):
        raise TypeError("a list of tables is missing")
    return value


def _file(tree: dict[str, object]) -> SealedFile:
    size = tree["size"]
    if not isinstance(size, int):
        raise TypeError("a file without its size")
    return SealedFile(str(tree["name"]), size, tuple(_block(block) for block in _list(tree["blocks"])))


def _tree(folder: Path) -> dict[str, object]:
    try:
        tree = json.loads((folder / SEAL).read_text("utf-8"))
        version = tree["version"]
    except FileNotFoundError:
        raise TandemError(f"{folder}: it is not sealed; `tandem session seal {folder}`") from None
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise TandemError(f"{folder / SEAL}: cannot be read as a seal ({error})") from None
    if version != VERSION:
        raise TandemError(f"{folder / SEAL}: version {version}, this tandem knows {VERSION}")
    return dict(tree)


def _block(tree: dict[str, object]) -> Block:
    offset, length, times = tree["offset"], tree["length"], tree["times_ns"]
    if not isinstance(offset, int) or not isinstance(length, int):
        raise TypeError("a block without offset and length")
    spans = None if not isinstance(times, list) else (int(times[0]), int(times[1]))
    return Block(offset, length, str(tree["sha256"]), spans)
