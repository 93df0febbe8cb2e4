"""The example files of each profile: what demo and virtual run start from."""

from __future__ import annotations

from pathlib import Path

from common.skeleton import load_skeleton

EXAMPLES = Path(__file__).parent
NURSING = "nursing"
"""Whose files lie in the folder itself; each other profile has a folder of its own within."""


def example(role: str, profile: str = NURSING) -> Path:
    """The file of a role (`master`, `slave`, `suit`). Raises ConfigError where there is no such profile."""
    skeleton = load_skeleton(profile)
    folder = EXAMPLES if skeleton.name == NURSING else EXAMPLES / skeleton.name
    return folder / f"{role}.toml"
