"""`[[guard.zones]]`: what stands around the robot, where it may not be, or only slowly."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator, Sequence
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field

from common.config.section import Section
from common.quaternion import Array
from common.skeleton import Skeleton
from slave.model.distance import DistanceModel, Obstacle

_Point = Annotated[list[float], Field(min_length=3, max_length=3)]
_Size = Annotated[float, Field(gt=0.0, le=20.0)]
_ONE_CM = 0.01


class _Zone(Section):
    """What all zones have. Coordinates are in the robot's base frame, m: x ahead, y left, z up."""

    geom: ClassVar[str]
    """MuJoCo's word for its shape."""

    name: str = Field(min_length=1, max_length=40)
    margin_cm: float = Field(3.0, ge=0.0, le=50.0)
    """No part of the robot comes nearer than this."""
    enter: bool = False
    """True: the robot may be inside; the margin then counts for nothing, and only the speed is limited."""
    max_speed_m_s: float | None = Field(None, gt=0.0, le=10.0)
    """The greatest speed of a part at its point nearest to the zone, inside the margin (or inside of the zone
    itself, where the robot may enter); further out the limit grows by 1 m/s each 10 cm."""

    max_force_n: float | None = Field(None, ge=10.0, le=10_000.0)
    """The greatest force of a part that presses there, as the motors' torques tell it: beyond it, a
    protective stop. Counts within the margin, or inside of the zone itself where the robot may enter."""

    max_blind_cm: float | None = Field(None, ge=1.0, le=200.0)
    """Should the line die, no hand's end goes farther than this within the margin (or inside of the zone
    itself where the robot may enter), wherever it comes from: hands are slowed so that it holds. With less
    than 1 cm a hand could hardly move there, not even out."""

    @property
    def margin_m(self) -> float:
        """-inf where the robot may enter."""
        return -np.inf if self.enter else _ONE_CM * self.margin_cm

    @abstractmethod
    def distance_m(self, point_m: Array) -> Array:
        """(N,) from points (N, 3), base frame; 0 inside."""

    @abstractmethod
    def _attributes(self) -> dict[str, Sequence[float]]:
        """Where it is and how large, as attributes of MuJoCo's geom."""

    def obstacle(self) -> Obstacle:
        """The same for the model."""
        numbers = {key: " ".join(map(repr, values)) for key, values in self._attributes().items()}
        return Obstacle(self.name, (("type", self.geom), *numbers.items()))


class BoxZone(_Zone):
    """A box that stands upright, such as a bed or a table."""

    geom = "box"
    shape: Literal["box"]
    center_m: _Point
    size_m: Annotated[list[_Size], Field(min_length=3, max_length=3)]
    """Whole length, width and height."""
    yaw_deg: float = Field(0.0, ge=-360.0, le=360.0)
    """How far it is turned to the left."""

    def distance_m(self, point_m: Array) -> Array:
        """See `_Zone`."""
        cos, sin = np.cos(np.radians(self.yaw_deg)), np.sin(np.radians(self.yaw_deg))
        from_center = point_m - np.array(self.center_m)
        local = from_center @ np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
        beyond = np.maximum(np.abs(local) - 0.5 * np.array(self.size_m), 0.0)
        return np.asarray(np.linalg.norm(beyond, axis=1))

    def _attributes(self) -> dict[str, Sequence[float]]:
        half = 0.5 * np.radians(self.yaw_deg)
        quat = [float(np.cos(half)), 0.0, 0.0, float(np.sin(half))]
        return {"pos": self.center_m, "size": [0.5 * size for size in self.size_m], "quat": quat}


class CapsuleZone(_Zone):
    """All within a radius of a line, such as an arm rest or a lying person."""

    geom = "capsule"
    shape: Literal["capsule"]
    from_m: _Point
    to_m: _Point
    radius_m: _Size

    def distance_m(self, point_m: Array) -> Array:
        """See `_Zone`."""
        begin, way = np.array(self.from_m), np.array(self.to_m) - np.array(self.from_m)
        share = np.clip((point_m - begin) @ way / (way @ way), 0.0, 1.0)
        off_m = np.linalg.norm(point_m - begin - share[:, None] * way, axis=1)
        return np.asarray(np.maximum(off_m - self.radius_m, 0.0))

    def _attributes(self) -> dict[str, Sequence[float]]:
        return {"fromto": [*self.from_m, *self.to_m], "size": [self.radius_m]}


class SphereZone(_Zone):
    """All within a radius of a point, such as the place of the patient's head."""

    geom = "sphere"
    shape: Literal["sphere"]
    center_m: _Point
    radius_m: _Size

    def distance_m(self, point_m: Array) -> Array:
        """See `_Zone`."""
        off_m = np.linalg.norm(point_m - np.array(self.center_m), axis=1)
        return np.asarray(np.maximum(off_m - self.radius_m, 0.0))

    def _attributes(self) -> dict[str, Sequence[float]]:
        return {"pos": self.center_m, "size": [self.radius_m]}


class HalfSpaceZone(_Zone):
    """All behind a plane, such as a wall or the floor."""

    geom = "plane"
    shape: Literal["half_space"]
    point_m: _Point
    """Any point of the plane."""
    free_side: _Point
    """Which way from the plane the robot may be; of any length but 0."""

    def distance_m(self, point_m: Array) -> Array:
        """See `_Zone`."""
        free = np.array(self.free_side) / np.linalg.norm(self.free_side)
        return np.asarray(np.maximum((point_m - np.array(self.point_m)) @ free, 0.0))

    def _attributes(self) -> dict[str, Sequence[float]]:
        return {"pos": self.point_m, "zaxis": self.free_side, "size": [0.0, 0.0, 1.0]}


Zone = Annotated[BoxZone | CapsuleZone | SphereZone | HalfSpaceZone, Field(discriminator="shape")]


def zone_margins_m(self_margin_cm: float, zones: Sequence[Zone]) -> list[float]:
    """Of the robot's own parts, then of each zone."""
    return [_ONE_CM * self_margin_cm, *(zone.margin_m for zone in zones)]


def distance_model(skeleton: Skeleton, self_margin_cm: float, zones: Sequence[Zone]) -> DistanceModel:
    """The robot among its zones."""
    kept_m = [max(margin_m, 0.0) for margin_m in zone_margins_m(self_margin_cm, zones)]
    return DistanceModel(skeleton, [zone.obstacle() for zone in zones], kept_m)


def zone_mistakes(
    skeleton: Skeleton, self_margin_cm: float, zones: Sequence[Zone]
) -> Iterator[tuple[str, object, str]]:
    """Zones that contradict themselves, and zones and margins that the zero pose is inside of.

    Such a zone is refused, rather than told of: the robot begins and ends its work near the zero pose, and
    the damper would let it leave but never come back. A wrong coordinate looks just like that.
    """
    names = [zone.name for zone in zones]
    sound = True
    for i, zone in enumerate(zones):
        for key, value, expected in _own_mistakes(zone, names[:i]):
            sound = False
            yield f"zones.{i}.{key}", value, expected
    if not sound:
        return
    model = distance_model(skeleton, self_margin_cm, zones)
    margin_m = np.array(zone_margins_m(self_margin_cm, zones))
    near = model.near(np.clip(skeleton.zero_rad, skeleton.lower_rad, skeleton.upper_rad))
    for owner in range(-1, len(zones)):
        rows = np.flatnonzero(model.obstacle[near.pair] == owner)
        if not len(rows):
            continue
        k = int(rows[np.argmin(near.distance_m[rows])])
        part, other = model.names[near.pair[k]]
        stands_cm = 100.0 * float(near.distance_m[k])
        if stands_cm < 100.0 * margin_m[owner + 1]:
            place = f"{stands_cm:.1f} cm from" if stands_cm >= 0.0 else f"{-stands_cm:.1f} cm inside of"
            said = f"in the zero pose, {part} is {place} {f'the {other}' if owner < 0 else 'it'}"
            if owner < 0:
                yield "self_margin_cm", self_margin_cm, f"at most {stands_cm:.1f}: {said}"
            else:
                yield f"zones.{owner}", zones[owner].name, f"a place further from the robot: {said}"


def _own_mistakes(zone: Zone, earlier: Sequence[str]) -> Iterator[tuple[str, object, str]]:
    if zone.name in earlier:
        yield "name", zone.name, "another name: an earlier zone has it"
    limits = (zone.max_speed_m_s, zone.max_force_n, zone.max_blind_cm)
    if zone.enter and all(limit is None for limit in limits):
        yield "enter", True, "max_speed_m_s with it, or max_force_n or max_blind_cm, or it would do nothing"
    if isinstance(zone, HalfSpaceZone) and not any(zone.free_side):
        yield "free_side", zone.free_side, "a direction: not all three 0"
    if isinstance(zone, CapsuleZone) and zone.from_m == zone.to_m:
        yield "to_m", zone.to_m, "another point than from_m (else a sphere)"


def speed_limits(zones: Sequence[Zone]) -> tuple[Array, Array]:
    """Of each zone: its greatest speed, m/s (inf: any), and the distance, m, within which it counts."""
    speeds = [np.inf if zone.max_speed_m_s is None else zone.max_speed_m_s for zone in zones]
    return np.array(speeds), np.array([max(zone.margin_m, 0.0) for zone in zones])
