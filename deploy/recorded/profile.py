"""The robot profile of a recording: its head says it, or a person does."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path

from common.errors import RecordingError
from common.skeleton import Skeleton, load_skeleton
from common.skeleton.load import profile_names
from deploy.recorded.files import head_of
from deploy.recorded.recorded_config import recorded_config
from master.journal.context import CONFIG

USUAL = "nursing"


def recorded_skeleton(files: Sequence[Path], chosen: str | None = None) -> Skeleton:
    """The skeleton: of the chosen profile; else the one that some file's head names; else `nursing`.

    A master's recording holds a profile of one's own. Raises ConfigError, RecordingError.
    """
    if chosen is not None:
        return load_skeleton(chosen)
    for path in files:
        head = head_of(path)
        if CONFIG in head:
            with recorded_config(head, path.name) as config:
                return config.skeleton
        if "profile" in head:
            return _named(head, path)
    return load_skeleton(USUAL)


def _named(head: Mapping[str, str], path: Path) -> Skeleton:
    name = head["profile"]
    if name not in profile_names():
        raise RecordingError(f"{path}: it is of the profile {name}; give its folder as --profile FOLDER")
    skeleton = load_skeleton(name)
    if "joints" in head and json.loads(head["joints"]) != list(skeleton.joint_names):
        raise RecordingError(f"{path}: its joints are not those of this version's profile {name}")
    return skeleton
