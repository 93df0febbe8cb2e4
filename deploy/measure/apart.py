"""How near parts of the robot come to each other and to zones, computed apart from the slave's own way.

The slave asks MuJoCo, posture by posture. Here the table's kinematics and closed formulas are used, for a
whole course at once: so each is a check of the other.
"""

from __future__ import annotations

from collections.abc import Sequence, Set

import numpy as np

from common.quaternion import Array, rotate
from common.skeleton import Skeleton
from common.skeleton.kinematics import orientations, origins
from common.skeleton.links import hinge_values, place_links
from slave.guard.zones import BoxZone, CapsuleZone, HalfSpaceZone, SphereZone, Zone
from slave.model.capsules import capsules, links
from slave.model.pairs import moving, pairs

_HALVINGS = 25
_TOGETHER = 16
_NEAR_M = 0.12
"""Only what comes nearer than this is computed posture by posture."""


class Distances:
    """Distances of a robot among its zones; postures (T, J) at a time."""

    def __init__(self, skeleton: Skeleton, zones: Sequence[Zone] = ()) -> None:
        self._skeleton, self._zones = skeleton, zones
        shape = capsules(skeleton)
        self._segment = np.array([c.segment for c in shape])
        self._ends = np.array([[c.from_m, c.to_m] for c in shape])
        self._radius = np.array([c.radius_m for c in shape])
        self._pairs = np.array(pairs(skeleton), np.intp).reshape(-1, 2)
        self._moving = np.array(moving(skeleton), np.intp)

    def own_m(self, position_rad: Array) -> Array:
        """(T,) the least distance between two parts of the robot, or one and its stand; inf without pairs."""
        parts = [self._own_m(rows) for rows in _blocks(position_rad)]
        return np.concatenate(parts) if parts else np.empty(0)

    def between_m(self, position_rad: Array, one: Set[str], other: Set[str]) -> Array:
        """(T,) the least distance between bodies of these names; inf where no such pair is kept apart."""
        names = [link.name for link in links(self._skeleton)]
        first, second = (
            np.isin(self._segment, [i for i, n in enumerate(names) if n in some]) for some in (one, other)
        )
        a, b = self._pairs.T
        chosen = (first[a] & second[b]) | (first[b] & second[a])
        a, b = a[chosen], b[chosen]
        if not len(a):
            return np.full(len(position_rad), np.inf)
        ends = [self._placed(rows) for rows in _blocks(position_rad)]
        return np.concatenate(
            [(_between(e[:, a], e[:, b]) - self._radius[a] - self._radius[b]).min(axis=1) for e in ends]
        )

    def _own_m(self, position_rad: Array) -> Array:
        ends, radius = self._placed(position_rad), self._radius
        a, b = self._pairs.T
        least = np.full(len(position_rad), np.inf)
        if len(a):
            apart = _between(ends[:, a], ends[:, b]) - radius[a] - radius[b]
            least = apart.min(axis=1)
        for post in self._skeleton.stand:
            if len(self._moving):
                bar = np.broadcast_to([post.from_m, post.to_m], (len(least), len(self._moving), 2, 3))
                apart = _between(ends[:, self._moving], bar) - radius[self._moving] - post.radius_m
                least = np.minimum(least, apart.min(axis=1))
        return least

    def to_zones_m(self, position_rad: Array) -> Array:
        """(T, zones) the least distance of any part to each."""
        parts = [self._to_zones_m(rows) for rows in _blocks(position_rad)]
        return np.concatenate(parts) if parts else np.empty((0, len(self._zones)))

    def _to_zones_m(self, position_rad: Array) -> Array:
        ends = self._placed(position_rad)
        out = [(_to_zone(zone, ends) - self._radius).min(axis=1) for zone in self._zones]
        return np.stack(out, axis=1) if out else np.empty((len(position_rad), 0))

    def on_the_way_m(self, course_rad: Array) -> tuple[float, list[float]]:
        """The least distance on the way through postures (T, J): of the robot's own parts, and to each zone.

        Midway between two postures counts too. What stays further apart than 12 cm counts as that: a
        distance shrinks by no more than both capsules' ends have moved. So only few have to be computed.
        """
        ends = self._placed(course_rad)
        least, zones = _NEAR_M, [_NEAR_M] * len(self._zones)
        for k in range(0, len(ends) - 1, _TOGETHER):
            some = ends[k : k + _TOGETHER + 1]
            # of a line, not of the arc: 0.03 mm less at 4 rad/s, half a metre out, and 200 Hz
            some = np.concatenate([some, 0.5 * (some[1:] + some[:-1])])
            moved_m = np.linalg.norm(some - some[:1], axis=-1).max(axis=(0, 2))
            least = min(least, self._least_own_m(some, moved_m))
            for i, zone in enumerate(self._zones):
                first_m = _to_zone(zone, some[:1])[0] - self._radius - moved_m
                near = np.flatnonzero(first_m < _NEAR_M)
                if len(near):
                    apart = _to_zone(zone, some[:, near]) - self._radius[near]
                    zones[i] = min(zones[i], float(apart.min()))
        return least, zones

    def _least_own_m(self, ends: Array, moved_m: Array) -> float:
        bars = [([*post.from_m], [*post.to_m], post.radius_m) for post in self._skeleton.stand]
        a, b = self._pairs.T
        moving = self._moving
        fixed = np.array([bar[:2] for bar in bars]).reshape(-1, 2, 3)
        place = np.concatenate([ends, np.broadcast_to(fixed, (len(ends), *fixed.shape))], axis=1)
        radius = np.append(self._radius, [bar[2] for bar in bars])
        moved_m = np.append(moved_m, np.zeros(len(bars)))
        posts = np.arange(len(self._radius), len(radius))
        a = np.append(a, np.tile(moving, len(posts)))
        b = np.append(b, np.repeat(posts, len(moving)))
        if not len(a):
            return _NEAR_M
        close_m = _between(place[:1, a], place[:1, b])[0] - radius[a] - radius[b]
        near = close_m - moved_m[a] - moved_m[b] < _NEAR_M
        if not near.any():
            return _NEAR_M
        a, b = a[near], b[near]
        apart = _between(place[:, a], place[:, b]) - radius[a] - radius[b]
        return min(_NEAR_M, float(apart.min()))

    def _placed(self, position_rad: Array) -> Array:
        """(T, C, 2, 3) both ends of every capsule's line."""
        own = self._skeleton.own_links
        if own:
            placed = place_links(own, hinge_values(self._skeleton.joints, position_rad))
            origin_m, q = (np.stack([placed[link.name][k] for link in own], axis=1) for k in (0, 1))
        else:
            q = orientations(self._skeleton, position_rad)
            origin_m = origins(self._skeleton, q)
        turned = rotate(
            q[:, self._segment, None, :], np.broadcast_to(self._ends, (len(q), *self._ends.shape))
        )
        out: Array = origin_m[:, self._segment, None, :] + turned
        return out


def _blocks(position_rad: Array) -> list[Array]:
    """Rows by the hundred, which fit into a processor's cache."""
    return [position_rad[k : k + 100] for k in range(0, len(position_rad), 100)]


def _between(one: Array, other: Array) -> Array:
    """(...) the least distance between lines (..., 2, 3): Ericson, Real-Time Collision Detection, 5.1.9."""
    p, q = one[..., 0, :], other[..., 0, :]
    d, e = one[..., 1, :] - p, other[..., 1, :] - q
    r = p - q
    a, b, c = (d * d).sum(-1), (d * e).sum(-1), (d * r).sum(-1)
    f, g = (e * e).sum(-1), (e * r).sum(-1)
    parallel = a * f - b * b
    s = np.where(
        parallel > 1e-12, np.clip((b * g - c * f) / np.where(parallel > 1e-12, parallel, 1.0), 0, 1), 0.0
    )
    t = np.clip((b * s + g) / f, 0.0, 1.0)
    s = np.clip((b * t - c) / a, 0.0, 1.0)
    gap = r + s[..., None] * d - t[..., None] * e
    out: Array = np.sqrt((gap * gap).sum(-1))
    return out


def _to_zone(zone: Zone, ends: Array) -> Array:
    """(T, C) from the lines (T, C, 2, 3) to a zone."""
    if isinstance(zone, HalfSpaceZone):
        free = np.array(zone.free_side) / np.linalg.norm(zone.free_side)
        return np.asarray(((ends - np.array(zone.point_m)) @ free).min(axis=2))
    if isinstance(zone, CapsuleZone):
        return _between(ends, np.broadcast_to([zone.from_m, zone.to_m], ends.shape)) - zone.radius_m
    if isinstance(zone, SphereZone):
        point = np.broadcast_to([zone.center_m, zone.center_m], ends.shape) + [[[0, 0, 0], [0, 0, 1e-9]]]
        return _between(ends, point) - zone.radius_m
    return _to_box(zone, ends)


def _to_box(zone: BoxZone, ends: Array) -> Array:
    """A box is convex, so the distance along a line has one minimum: halve the interval."""
    yaw = np.radians(zone.yaw_deg)
    turn = np.array([[np.cos(yaw), -np.sin(yaw), 0.0], [np.sin(yaw), np.cos(yaw), 0.0], [0.0, 0.0, 1.0]])
    local = (ends - np.array(zone.center_m)) @ turn
    half = 0.5 * np.array(zone.size_m)

    def at(share: Array) -> Array:
        over = np.abs(local[..., 0, :] + share[..., None] * (local[..., 1, :] - local[..., 0, :])) - half
        outside = np.linalg.norm(np.maximum(over, 0.0), axis=-1)
        out: Array = outside + np.minimum(over.max(axis=-1), 0.0)
        return out

    low, high = np.zeros(ends.shape[:2]), np.ones(ends.shape[:2])
    for _ in range(_HALVINGS):
        one, two = low + (high - low) / 3.0, high - (high - low) / 3.0
        left = at(one) < at(two)
        low, high = np.where(left, low, one), np.where(left, two, high)
    return at(0.5 * (low + high))
