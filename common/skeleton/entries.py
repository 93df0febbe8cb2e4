"""The keys of a profile's file (the head of nursing.toml explains them), checked one by one."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from common.config.section import RelativePath, Section
from common.skeleton.table import Bar, Point, Post, RobotHinge, RobotLink, Segment, Shape, Synergy

_UNIT = {"x": (1, 0, 0), "y": (0, 1, 0), "z": (0, 0, 1)}

Metres = Annotated[list[float], Field(min_length=3, max_length=3)]
Name = Annotated[str, Field(pattern=r"^\S+$")]
Ratios = dict[Name, float]
Three = Annotated[str, Field(pattern=r"^\S+ \S+ \S+$")]
Axes = Annotated[str, Field(pattern=r"^-?[xyz] -?[xyz] -?[xyz]$")]


class ShapeEntry(Section):
    """`shape` of a segment."""

    radius_m: float | None = None
    fan: bool = False
    tip_m: Metres | None = None

    def made(self) -> Shape:
        """The table's."""
        return Shape(self.radius_m, self.fan, None if self.tip_m is None else point(self.tip_m))


class SegmentEntry(Section):
    """`[[segment]]`."""

    name: Name
    parent: Name
    axes: Axes = "z y x"
    angles: Three = "_ _ _"
    human: Three = "1 2 3"
    group: Name | None = None
    origin_m: Metres
    node_m: Metres
    shape: ShapeEntry = ShapeEntry()
    link: Name | None = None

    def made(self) -> Segment:
        """The table's; its chain is not yet known."""
        first, second, third = (_axis(a) for a in self.axes.split())
        one, two, three = (None if a == "_" else a for a in self.angles.split())
        flexes, tilts, twists = (m != "_" for m in self.human.split())
        return Segment(
            name=self.name,
            parent=self.parent,
            axes=(first, second, third),
            angles=(one, two, three),
            origin_m=point(self.origin_m),
            node_m=point(self.node_m),
            human=(flexes, tilts, twists),
            shape=self.shape.made(),
            group=self.group,
            link=self.link,
        )


class PostEntry(Section):
    """`[[stand]]`."""

    from_m: Metres
    to_m: Metres
    radius_m: float

    def made(self) -> Post:
        """The table's."""
        return Post(point(self.from_m), point(self.to_m), self.radius_m)


class JointEntry(Section):
    """`[[joint]]`."""

    name: Name
    lower_deg: float
    upper_deg: float
    max_velocity_deg_s: float = Field(gt=0.0)
    max_acceleration_deg_s2: float = Field(gt=0.0)
    drives: Ratios | None = None
    hinges: Ratios | None = None
    zero_deg: float = 0.0


class SynergyEntry(Section):
    """`[[synergy]]`."""

    name: Name
    drives: Ratios

    def made(self) -> Synergy:
        """The table's."""
        return Synergy(self.name, self.drives)


class HingeEntry(Section):
    """One of a link's `hinges`."""

    name: Name
    axis: Metres
    anchor_m: Metres = Field(default=[0.0, 0.0, 0.0])
    slides: bool = False

    def made(self) -> RobotHinge:
        """The table's, the axis made one of length 1."""
        length = sum(a * a for a in self.axis) ** 0.5 or 1.0
        axis = point([a / length for a in self.axis])
        return RobotHinge(self.name, axis, point(self.anchor_m), self.slides)


class BarEntry(Section):
    """One of a link's `bars`."""

    from_m: Metres
    to_m: Metres
    radius_m: float = Field(gt=0.0)

    def made(self) -> Bar:
        """The table's."""
        return Bar(point(self.from_m), point(self.to_m), self.radius_m)


class LinkEntry(Section):
    """`[[link]]`."""

    name: Name
    parent: Name
    origin_m: Metres
    q_parent_from_link: Annotated[list[float], Field(min_length=4, max_length=4)] = Field(
        default=[1.0, 0.0, 0.0, 0.0]
    )
    hinges: list[HingeEntry] = Field(default=[])
    bars: list[BarEntry] = Field(default=[])

    def made(self) -> RobotLink:
        """The table's, the quaternion made one of length 1."""
        length = sum(a * a for a in self.q_parent_from_link) ** 0.5 or 1.0
        w, x, y, z = (a / length for a in self.q_parent_from_link)
        hinges = tuple(entry.made() for entry in self.hinges)
        bars = tuple(entry.made() for entry in self.bars)
        return RobotLink(self.name, self.parent, point(self.origin_m), (w, x, y, z), hinges, bars)


class ProfileFile(Section):
    """The whole file."""

    name: str = Field(pattern=r"^[A-Za-z0-9_.-]{1,64}$")
    model: RelativePath | None = None
    unconfirmed: list[str] = Field(default=[])
    segment: list[SegmentEntry] = Field(min_length=1)
    joint: list[JointEntry] = Field(min_length=1)
    synergy: list[SynergyEntry] = Field(default=[])
    stand: list[PostEntry] = Field(default=[])
    link: list[LinkEntry] = Field(default=[])


def point(values: list[float]) -> Point:
    """Three numbers as the table keeps them."""
    x, y, z = values
    return (x, y, z)


def _axis(text: str) -> tuple[int, int, int]:
    sign = -1 if text.startswith("-") else 1
    x, y, z = _UNIT[text.lstrip("-")]
    return (sign * x, sign * y, sign * z)
