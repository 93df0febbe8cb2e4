"""Which code a run is by: what two versions of it found does not add up."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from pathlib import Path

import common
import master
import slave
from common.wire.version import installed

PACKAGES = (
    *(Path(package.__path__[0]) for package in (common, master, slave)),
    Path(__file__).parents[1],  # deploy itself: importing it by name from within would be a circle
)
COMPUTES = ("daqp", "mujoco", "numpy")
"""Packages that another version of may come to other figures."""
_KINDS = (".py", ".toml")


def code_state(folders: Sequence[Path] = PACKAGES) -> str:
    """A digest of all code and settings in these folders, and of the versions of what they compute with.

    16 hexadecimal digits. It changes with a comment, too: whoever goes on with a long run does so by the
    checkout in which it began.
    """
    digest = hashlib.sha256(repr([(package, installed(package)) for package in COMPUTES]).encode())
    for folder in folders:
        for file in sorted(each for each in folder.rglob("*") if each.suffix in _KINDS):
            digest.update(f"\0{folder.name}/{file.relative_to(folder).as_posix()}\0".encode())
            digest.update(hashlib.sha256(file.read_bytes()).digest())
    return digest.hexdigest()[:16]
