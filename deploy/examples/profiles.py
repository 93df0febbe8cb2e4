"""The example files of each profile: what demo and virtual run start from."""

from __future__ import annotations

from pathlib import Path

from common.skeleton import load_skeleton
from common.skeleton.load import own_profile

EXAMPLES = Path(__file__).parent
NURSING = "nursing"
"""Whose files lie in the folder itself; each other profile that ships has a folder of its own within."""


def example(role: str, profile: str = NURSING) -> Path:
    """The file of a role (`master`, `slave`, `suit`); of a profile of one's own, beside that profile.

    Raises ConfigError where there is no such profile.
    """
    own = own_profile(profile)
    if own is not None and own.is_file():
        return own.parent / f"{role}.toml"
    skeleton = load_skeleton(profile)
    folder = EXAMPLES if skeleton.name == NURSING else EXAMPLES / skeleton.name
    return folder / f"{role}.toml"
