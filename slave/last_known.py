"""The joints' last angles, kept on disk, so that a robot that is switched on again can compare.

The file is written seldom and never by the control loop. It is replaced whole: a power cut leaves the old one
or the new one.
"""

from __future__ import annotations

import json
import logging
import math
import os
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from common.quaternion import Array

EVERY_S = 5.0
"""Least time between two writes."""
CHANGED_RAD = math.radians(1.0)
"""Written only after some joint has moved by more than this."""

log = logging.getLogger(__name__)


def state_file(robot: str, environment: Mapping[str, str]) -> Path:
    """Where it is kept: systemd's StateDirectory, else the user's own (XDG base directories)."""
    folder = environment.get("STATE_DIRECTORY", "").partition(":")[0]
    if folder:
        return Path(folder) / f"{robot}.last-known.json"
    home = environment.get("XDG_STATE_HOME") or str(Path(environment.get("HOME", "/")) / ".local" / "state")
    return Path(home) / "tandem" / f"{robot}.last-known.json"


def load(file: Path) -> dict[str, float]:
    """The joints' angles, rad, by joint; empty where nothing is known. What cannot be read is logged."""
    try:
        kept = json.loads(file.read_text("utf-8"))
        angles = {str(joint): float(angle) for joint, angle in kept["position_rad"].items()}
    except FileNotFoundError:
        return {}
    except (OSError, ValueError, TypeError, KeyError, AttributeError) as error:
        log.warning("%s: cannot read the last known joint angles, so none are known: %s", file, error)
        return {}
    return {joint: angle for joint, angle in angles.items() if math.isfinite(angle)}


def save(file: Path, position_rad: Mapping[str, float]) -> None:
    """Replace the file, whole. Raises OSError."""
    file.parent.mkdir(parents=True, exist_ok=True)
    beside = file.with_suffix(".new")
    with beside.open("w", encoding="utf-8") as out:
        json.dump({"position_rad": dict(position_rad)}, out)
        out.flush()
        os.fsync(out.fileno())
    beside.replace(file)


class LastKnown:
    """One robot's file. `due` is cheap; `keep` writes, so call it in a thread."""

    def __init__(self, file: Path, joint_names: tuple[str, ...]) -> None:
        self.file = file
        self._names = joint_names
        self.before_rad = load(file)
        """Where the joints stood before this process began, by joint."""
        self._kept: Array | None = None
        self._failed = False

    def due(self, position_rad: Array) -> bool:
        """Whether these angles (J,) differ from those on disk."""
        return self._kept is None or bool(np.abs(position_rad - self._kept).max() > CHANGED_RAD)

    def keep(self, position_rad: Array) -> None:
        """Write these angles (J,). A disk that fails is logged once and does not stop the robot."""
        try:
            save(self.file, dict(zip(self._names, position_rad.tolist(), strict=True)))
        except OSError as error:
            if not self._failed:
                log.warning("%s: cannot save the joint angles: %s", self.file, error)
            self._failed = True
            return
        self._kept, self._failed = position_rad.copy(), False
