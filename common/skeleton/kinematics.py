"""Forward kinematics: joint positions to the orientation and place of every segment."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from common.quaternion import IDENTITY, Array, heading_turn, multiply, rotate
from common.skeleton.table import Skeleton


@dataclass(frozen=True, slots=True)
class _Chain:
    """What of a skeleton the formulas need, worked out once."""

    zero_rad: Array
    turn_axes: Array
    """(N, K, 3)"""
    plain: bool
    half_angles: Array
    """(J, K N): joint positions to halves of the segment angles; of a plain skeleton, the third made
    right-handed."""
    order: NDArray[np.intp]
    """(3 N,): where each component of a segment's own frame stands among the axis-frame components."""
    sign: Array
    """(3 N,): and its sign there."""
    roots: NDArray[np.intp]
    jumps: tuple[NDArray[np.intp], ...]
    """(N + 1,) each: everyone's ancestor 1, 2, 4, … generations up; row N is the world, its own ancestor."""
    above: Array
    """(N, N): 1 where the column is the row's segment or an ancestor of it."""
    parents: NDArray[np.intp]
    origin_m: Array


@lru_cache(maxsize=16)
def _chain(skeleton: Skeleton) -> _Chain:
    count = len(skeleton.segments)
    parents = skeleton.parents
    scale = np.full(skeleton.turn_axes.shape[:2], 0.5)
    if skeleton.plain:
        scale[:, 2] *= skeleton.axis_handedness
    order = np.argmax(np.abs(skeleton.axis_frames), axis=-1)
    sign = np.take_along_axis(skeleton.axis_frames, order[..., None], axis=-1)[..., 0]
    jumps = []
    ancestors = np.append(np.where(parents < 0, count, parents), count)
    while np.any(ancestors < count):
        jumps.append(ancestors)
        ancestors = ancestors[ancestors]
    above = np.eye(count)
    for i, parent in enumerate(parents):
        if parent >= 0:
            above[i] += above[parent]
    return _Chain(
        zero_rad=skeleton.zero_rad,
        turn_axes=skeleton.turn_axes,
        plain=skeleton.plain,
        half_angles=(skeleton.angles_from_joints * scale.reshape(-1, 1)).T.copy(),
        order=(order + 3 * np.arange(count)[:, None]).ravel(),
        sign=sign.ravel(),
        roots=np.flatnonzero(parents < 0),
        jumps=tuple(jumps),
        above=above,
        parents=parents,
        origin_m=np.array([s.origin_m for s in skeleton.segments]),
    )


def orientations(skeleton: Skeleton, position_rad: Array, heading_rad: ArrayLike = 0.0) -> Array:
    """Orientation of every segment, (..., N, 4), world from segment, for joint positions (..., J).

    Residual angles, which no joint drives, are zero. `heading_rad` (...) turns the whole body about the
    vertical.
    """
    chain = _chain(skeleton)
    q = _local(chain, position_rad)
    heading = np.asarray(heading_rad, dtype=np.float64)
    if heading.any():
        q = _turned(chain, q, heading)
    # pointer doubling: after each round a row holds the rotation from twice as many generations up
    for ancestors in chain.jumps:
        q = multiply(q.take(ancestors, axis=-2), q)
    return q[..., :-1, :]


def relative_orientations(skeleton: Skeleton, position_rad: Array) -> Array:
    """Rotation of every segment relative to its neighbour, (..., N, 4), parent from segment, for (..., J)."""
    return _local(_chain(skeleton), position_rad)[..., :-1, :]


def _local(chain: _Chain, position_rad: Array) -> Array:
    """Each segment's rotation from its parent, and the world's identity, (..., N + 1, 4)."""
    if not chain.plain:
        return _turn_by_turn(chain, position_rad)
    half = position_rad @ chain.half_angles
    half = half.reshape(*half.shape[:-1], -1, 3)
    c, s = np.cos(half), np.sin(half)
    c1, c2, c3 = c[..., 0], c[..., 1], c[..., 2]
    s1, s2, s3 = s[..., 0], s[..., 1], s[..., 2]
    cc, ss, sc, cs = c1 * c2, s1 * s2, s1 * c2, c1 * s2
    # (c1 + i s1)(c2 + j s2)(c3 + k s3): intrinsic x-y-z in the axis frame
    vector = np.empty_like(half)
    vector[..., 0] = sc * c3 + cs * s3
    vector[..., 1] = cs * c3 - sc * s3
    vector[..., 2] = cc * s3 + ss * c3
    q = np.empty((*half.shape[:-2], half.shape[-2] + 1, 4))
    q[..., :-1, 0] = cc * c3 - ss * s3
    flat = vector.reshape(*vector.shape[:-2], -1)
    q[..., :-1, 1:] = (flat.take(chain.order, axis=-1) * chain.sign).reshape(vector.shape)
    q[..., -1, :] = IDENTITY
    return q


def _turn_by_turn(chain: _Chain, position_rad: Array) -> Array:
    """The same for any number of turns about any axes."""
    half = (position_rad - chain.zero_rad) @ chain.half_angles
    half = half.reshape(*half.shape[:-1], *chain.turn_axes.shape[:2])
    c, s = np.cos(half), np.sin(half)[..., None] * chain.turn_axes
    q = np.tile(IDENTITY, (*half.shape[:-2], half.shape[-2] + 1, 1))
    for k in range(half.shape[-1]):
        q[..., :-1, :] = multiply(q[..., :-1, :], np.concatenate([c[..., k, None], s[..., k, :]], axis=-1))
    return q


def _turned(chain: _Chain, q: Array, heading_rad: Array) -> Array:
    """The same with the roots turned about the vertical; headings (...) and q (..., N + 1, 4) broadcast."""
    shape = np.broadcast_shapes(heading_rad.shape, q.shape[:-2])
    q = np.broadcast_to(q, (*shape, *q.shape[-2:])).copy()
    q[..., chain.roots, :] = multiply(heading_turn(heading_rad)[..., None, :], q[..., chain.roots, :])
    return q


def origins(skeleton: Skeleton, q_world_from_segment: Array) -> Array:
    """World position of every segment's joint, (..., N, 3) m, for orientations (..., N, 4).

    A root segment's joint stands at its `origin_m`.
    """
    chain = _chain(skeleton)
    offset_m = rotate(q_world_from_segment.take(chain.parents, axis=-2), chain.origin_m)
    offset_m[..., chain.roots, :] = chain.origin_m[chain.roots]
    out: Array = chain.above @ offset_m
    return out
