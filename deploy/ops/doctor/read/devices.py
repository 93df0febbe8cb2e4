"""Device files and what draws the simulated robot's view."""

from __future__ import annotations

import ctypes
import importlib.util
import os
import shutil
from dataclasses import dataclass
from pathlib import Path

from deploy.ops.doctor.read.tree import Tree


@dataclass(frozen=True, slots=True)
class Device:
    """One device file."""

    path: str
    there: bool
    usable: bool
    """Whether this user may read and write it."""
    group: int = -1


def read_device(tree: Tree, path: str) -> Device:
    """Look at it without opening it: opening a serial port moves its lines."""
    at = tree.at(path)
    try:
        group = at.stat().st_gid
    except OSError:
        return Device(path, there=False, usable=False)
    return Device(path, there=True, usable=os.access(at, os.R_OK | os.W_OK), group=group)


def egl_is_there() -> bool:
    """Whether OpenGL can draw without a screen."""
    try:
        ctypes.CDLL("libEGL.so.1")
    except OSError:
        return False
    return True


def v4l2_is_there() -> bool:
    """Whether the package that reads real cameras is installed."""
    return importlib.util.find_spec("linuxpy") is not None


def free_bytes(folder: Path) -> int | None:
    """Room on the disk of a folder; None where the folder is not there."""
    try:
        return shutil.disk_usage(folder).free
    except OSError:
        return None
