"""Capsules around the shapes of a compiled model's bodies, in the bodies' own frames."""

from __future__ import annotations

import mujoco
import numpy as np

from common.quaternion import Array, rotate
from common.skeleton.table import Bar, Point

_GEOM = mujoco.mjtGeom
_MOST_BARS = 4
"""A body of more shapes than this gets one capsule around them all."""
_LEAST_RADIUS_M = 0.005
_LEAST_HALF_M = 0.0005
"""A capsule's line has two ends."""


def bars_of(model: mujoco.MjModel, body: int) -> tuple[Bar, ...]:
    """Of the shapes that may collide; of all shapes where none may."""
    geoms = [g for g in range(model.ngeom) if model.geom_bodyid[g] == body]
    hard = [g for g in geoms if model.geom_contype[g] or model.geom_conaffinity[g]] or geoms
    hard = [g for g in hard if model.geom_type[g] != _GEOM.mjGEOM_PLANE]
    if not hard:
        return ()
    if len(hard) <= _MOST_BARS:
        return tuple(_bar(model, g) for g in hard)
    return (_around(np.concatenate([_points(model, g) for g in hard])),)


def _bar(model: mujoco.MjModel, geom: int) -> Bar:
    """A sphere, capsule or cylinder keeps its line and radius; anything else is surrounded."""
    kind, size = int(model.geom_type[geom]), model.geom_size[geom]
    if kind in (_GEOM.mjGEOM_SPHERE, _GEOM.mjGEOM_CAPSULE, _GEOM.mjGEOM_CYLINDER):
        half = _LEAST_HALF_M if kind == _GEOM.mjGEOM_SPHERE else float(size[1])
        ends = _placed(model, geom, np.array([[0.0, 0.0, -half], [0.0, 0.0, half]]))
        return Bar(_point(ends[0]), _point(ends[1]), float(size[0]))
    return _around(_points(model, geom))


def _points(model: mujoco.MjModel, geom: int) -> Array:
    """(P, 3) points whose hull holds the shape."""
    kind, size = int(model.geom_type[geom]), model.geom_size[geom]
    if kind == _GEOM.mjGEOM_MESH:
        mesh = model.geom_dataid[geom]
        first, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
        return _placed(model, geom, model.mesh_vert[first : first + count].astype(np.float64))
    corners = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, -1).T.astype(np.float64)
    radius = float(size[0])
    half = {
        int(_GEOM.mjGEOM_SPHERE): np.full(3, radius),
        int(_GEOM.mjGEOM_CAPSULE): np.array([radius, radius, radius + float(size[1])]),
        int(_GEOM.mjGEOM_CYLINDER): np.array([radius, radius, float(size[1])]),
    }.get(kind, size)
    return _placed(model, geom, corners * half)


def _placed(model: mujoco.MjModel, geom: int, points: Array) -> Array:
    out: Array = rotate(model.geom_quat[geom], points) + model.geom_pos[geom]
    return out


def _around(points: Array) -> Bar:
    """The slimmest of the capsules along the points' three principal axes that holds all of them."""
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    _, _, axes = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)
    found = [_along(points, middle, axis) for axis in (*axes, *np.eye(3))]
    return min(found, key=_volume)


def _along(points: Array, middle: Array, axis: Array) -> Bar:
    along = (points - middle) @ axis
    aside = points - middle - along[:, None] * axis
    centre = 0.5 * (aside.min(axis=0) + aside.max(axis=0))
    apart = np.linalg.norm(aside - centre, axis=1)
    radius = max(_LEAST_RADIUS_M, float(apart.max()))
    # a point beside the axis needs the end's middle only so far out that the round end covers it
    reach = np.sqrt(np.maximum(radius**2 - apart**2, 0.0))
    low, high = float((along + reach).min()), float((along - reach).max())
    centred = 0.5 * (low + high)
    low, high = min(low, centred - _LEAST_HALF_M), max(high, centred + _LEAST_HALF_M)
    begin, end = (middle + centre + share * axis for share in (low, high))
    return Bar(_point(begin), _point(end), radius)


def _volume(bar: Bar) -> float:
    length = float(np.linalg.norm(np.subtract(bar.to_m, bar.from_m)))
    return bar.radius_m**2 * (length + 4.0 / 3.0 * bar.radius_m)


def _point(values: Array) -> Point:
    x, y, z = (round(float(v), 5) for v in values)
    return (x, y, z)
