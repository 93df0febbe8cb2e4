"""Read a skeleton's TOML and refuse one that contradicts itself."""

from __future__ import annotations

import math
import tomllib
from functools import cache
from importlib import resources
from typing import NotRequired, TypedDict

from common.errors import ConfigError, ConfigMistake
from common.skeleton.table import WORLD, Joint, Post, Segment, Shape, Skeleton, Synergy

_UNIT = {"x": (1, 0, 0), "y": (0, 1, 0), "z": (0, 0, 1)}

_Point = tuple[float, float, float]


class _ShapeEntry(TypedDict):
    radius_m: NotRequired[float]
    fan: NotRequired[bool]
    tip_m: NotRequired[list[float]]


class _SegmentEntry(TypedDict):
    name: str
    parent: str
    axes: str
    angles: str
    human: NotRequired[str]
    group: NotRequired[str]
    origin_m: list[float]
    node_m: list[float]
    shape: NotRequired[_ShapeEntry]


class _PostEntry(TypedDict):
    from_m: list[float]
    to_m: list[float]
    radius_m: float


class _JointEntry(TypedDict):
    name: str
    lower_deg: float
    upper_deg: float
    max_velocity_deg_s: float
    max_acceleration_deg_s2: float
    drives: NotRequired[dict[str, float]]


def profile_names() -> list[str]:
    """The profiles that ship with tandem."""
    files = resources.files(__package__).iterdir()
    return sorted(f.name.removesuffix(".toml") for f in files if f.name.endswith(".toml"))


@cache
def load_skeleton(name: str) -> Skeleton:
    """The named profile that ships with tandem, such as `nursing`.

    Raises ConfigError naming the profiles there are, or the entry that is wrong.
    """
    folder = resources.files(__package__)
    names = profile_names()
    if name not in names:
        raise ConfigError("skeleton", [ConfigMistake("profile", name, f"one of {', '.join(names)}")])
    return parse_skeleton(folder.joinpath(f"{name}.toml").read_text("utf-8"), source=f"{name}.toml")


def parse_skeleton(text: str, source: str) -> Skeleton:
    """A skeleton from TOML text (its form is described at the head of nursing.toml)."""
    table = tomllib.loads(text)
    skeleton = Skeleton(
        name=table["name"],
        segments=tuple(_segment(entry) for entry in table["segment"]),
        joints=tuple(_joint(entry) for entry in table["joint"]),
        synergies=tuple(Synergy(**entry) for entry in table.get("synergy", ())),
        stand=tuple(_post(entry) for entry in table.get("stand", ())),
    )
    mistakes = _mistakes(skeleton)
    if mistakes:
        raise ConfigError(source, mistakes)
    return skeleton


def _segment(entry: _SegmentEntry) -> Segment:
    first, second, third = (_axis(a) for a in entry["axes"].split())
    one, two, three = (None if a == "_" else a for a in entry["angles"].split())
    flexes, tilts, twists = (m != "_" for m in entry.get("human", "1 2 3").split())
    return Segment(
        name=entry["name"],
        parent=entry["parent"],
        axes=(first, second, third),
        angles=(one, two, three),
        origin_m=_point(entry["origin_m"]),
        node_m=_point(entry["node_m"]),
        human=(flexes, tilts, twists),
        shape=_shape(entry.get("shape", {})),
        group=entry.get("group"),
    )


def _shape(entry: _ShapeEntry) -> Shape:
    tip_m = entry.get("tip_m")
    return Shape(entry.get("radius_m"), entry.get("fan", False), None if tip_m is None else _point(tip_m))


def _post(entry: _PostEntry) -> Post:
    return Post(_point(entry["from_m"]), _point(entry["to_m"]), entry["radius_m"])


def _point(values: list[float]) -> _Point:
    x, y, z = values
    return (x, y, z)


def _axis(text: str) -> tuple[int, int, int]:
    sign = -1 if text.startswith("-") else 1
    x, y, z = _UNIT[text.lstrip("-")]
    return (sign * x, sign * y, sign * z)


def _joint(entry: _JointEntry) -> Joint:
    return Joint(
        name=entry["name"],
        lower_rad=math.radians(entry["lower_deg"]),
        upper_rad=math.radians(entry["upper_deg"]),
        max_velocity_rad_s=math.radians(entry["max_velocity_deg_s"]),
        max_acceleration_rad_s2=math.radians(entry["max_acceleration_deg_s2"]),
        drives=entry.get("drives", {entry["name"]: 1.0}),
    )


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
            wrong(f"{joint.name}.drives", joint.drives, "at least one angle, no ratio of 0")
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
