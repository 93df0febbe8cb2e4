"""Read a skeleton's TOML and refuse one that contradicts itself."""

from __future__ import annotations

import dataclasses
import math
import tomllib
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Annotated

from pydantic import AfterValidator, ValidationInfo

from common.config.load import check_config, load_config
from common.errors import ConfigError, ConfigMistake
from common.skeleton.entries import JointEntry, ProfileFile
from common.skeleton.links import chain_of, link_mistakes
from common.skeleton.table import WORLD, Joint, Segment, Skeleton

OWN_FILE = "robot.toml"
"""The profile within a robot's own folder."""


def profile_names() -> list[str]:
    """The profiles that ship with tandem."""
    files = resources.files(__package__).iterdir()
    return sorted(f.name.removesuffix(".toml") for f in files if f.name.endswith(".toml"))


def own_profile(name: str, folder: Path = Path()) -> Path | None:
    """The file of a profile that is named by its path, or by its folder; None for one that ships."""
    if name in profile_names():
        return None
    path = folder / name
    if path.is_dir():
        return path / OWN_FILE
    return path if name.endswith(".toml") or "/" in name else None


def _beside_the_file(name: str, info: ValidationInfo) -> str:
    path = own_profile(name, (info.context or {}).get("folder", Path()))
    return name if path is None else str(path.resolve())


ProfileName = Annotated[str, AfterValidator(_beside_the_file)]
"""A profile that ships, by its name; or one's own, by its path relative to the file that names it."""


@cache
def load_skeleton(name: str) -> Skeleton:
    """A profile: `nursing` or another that ships with tandem, or a path to one's own file or its folder.

    Raises ConfigError naming the profiles there are, or the entry that is wrong.
    """
    path = own_profile(name)
    if path is not None and (path.suffix == ".toml" or path.is_file()):
        return _skeleton(load_config(path, ProfileFile), str(path))
    names = profile_names()
    if name not in names:
        expected = f"one of {', '.join(names)}, or a path to a .toml file or to a folder with {OWN_FILE}"
        raise ConfigError("skeleton", [ConfigMistake("profile", name, expected)])
    folder = resources.files(__package__)
    return parse_skeleton(folder.joinpath(f"{name}.toml").read_text("utf-8"), source=f"{name}.toml")


def parse_skeleton(text: str, source: str) -> Skeleton:
    """A skeleton from TOML text (its form is described at the head of nursing.toml)."""
    return _skeleton(check_config(Path(source), tomllib.loads(text), ProfileFile), source)


def _skeleton(file: ProfileFile, source: str) -> Skeleton:
    skeleton = Skeleton(
        name=file.name,
        segments=tuple(entry.made() for entry in file.segment),
        joints=tuple(_joint(entry, own=bool(file.link)) for entry in file.joint),
        synergies=tuple(entry.made() for entry in file.synergy),
        stand=tuple(entry.made() for entry in file.stand),
        own_links=tuple(entry.made() for entry in file.link),
        model=file.model,
        unconfirmed=tuple(file.unconfirmed),
    )
    mistakes = []
    if file.link or file.model:
        mistakes = link_mistakes(skeleton)
        if not mistakes:
            skeleton = _with_chains(skeleton)
    mistakes = mistakes or _mistakes(skeleton)
    if mistakes:
        raise ConfigError(source, mistakes)
    return skeleton


def _joint(entry: JointEntry, own: bool) -> Joint:
    hinges = (entry.hinges or {entry.name: 1.0}) if own else None
    return Joint(
        name=entry.name,
        lower_rad=math.radians(entry.lower_deg),
        upper_rad=math.radians(entry.upper_deg),
        max_velocity_rad_s=math.radians(entry.max_velocity_deg_s),
        max_acceleration_rad_s2=math.radians(entry.max_acceleration_deg_s2),
        drives=entry.drives or hinges or {entry.name: 1.0},
        zero_rad=math.radians(entry.zero_deg),
        hinges=hinges,
    )


def _with_chains(skeleton: Skeleton) -> Skeleton:
    """The same, each segment that a link follows with its turns; a joint drives those of its hinges."""
    by_name: dict[str, Segment] = {}
    for segment in skeleton.segments:
        chain = chain_of(segment, by_name.get(segment.parent), skeleton.own_links, skeleton.joints)
        by_name[segment.name] = dataclasses.replace(segment, chain=chain)
    segments = tuple(by_name.values())
    turned = {turn.angle for segment in segments for turn in segment.turns}
    joints = []
    for joint in skeleton.joints:
        drives = {angle: ratio for angle, ratio in joint.drives.items() if angle in turned}
        joints.append(dataclasses.replace(joint, drives=drives))
    return dataclasses.replace(skeleton, segments=segments, joints=tuple(joints))


def _mistakes(skeleton: Skeleton) -> list[ConfigMistake]:
    mistakes: list[ConfigMistake] = []

    def wrong(key: str, value: object, expected: str) -> None:
        mistakes.append(ConfigMistake(key, value, expected))

    seen = {WORLD}
    for segment in skeleton.segments:
        if segment.parent not in seen:
            wrong(f"{segment.name}.parent", segment.parent, "a segment listed before it")
        if segment.name in seen:
            wrong("segment.name", segment.name, "a name used once")
        if sorted(tuple(map(abs, axis)) for axis in segment.axes) != [(0, 0, 1), (0, 1, 0), (1, 0, 0)]:
            wrong(f"{segment.name}.axes", segment.axes, "x, y and z in some order")
        unable = [a for a, turns in zip(segment.angles, segment.human, strict=True) if a and not turns]
        if unable:
            wrong(f"{segment.name}.human", unable, "a movement wherever there is an angle")
        seen.add(segment.name)
    driven: set[str] = set()
    for joint in skeleton.joints:
        if not joint.lower_rad < joint.upper_rad:
            wrong(f"{joint.name}.lower_deg", joint.lower_rad, "a limit below upper_deg")
        if not joint.drives or not all(joint.drives.values()):
            expected = "at least one angle, no ratio of 0"
            if skeleton.own_links:
                expected += "; leave the joint out if nothing that the operator wears moves it"
            wrong(f"{joint.name}.drives", joint.drives, expected)
        for angle in joint.drives:
            if angle not in skeleton.angle_slots or angle in driven:
                wrong(f"{joint.name}.drives", angle, "a segment's angle that no other joint drives")
            driven.add(angle)
    # each joint is in one synergy at most: least squares then stays a mean
    driven = set()
    for synergy in skeleton.synergies:
        if not synergy.drives or not all(synergy.drives.values()):
            wrong(f"{synergy.name}.drives", synergy.drives, "at least one joint, no ratio of 0")
        for name in synergy.drives:
            if name not in skeleton.joint_names or name in driven:
                wrong(f"{synergy.name}.drives", name, "a joint that no other synergy drives")
            driven.add(name)
    return mistakes
