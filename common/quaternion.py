"""Quaternions, wxyz, vectorised over any leading axes; `q_a_from_b` rotates b's coordinates into a's."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

IDENTITY: Array = np.array([1.0, 0.0, 0.0, 0.0])


def multiply(p: Array, q: Array) -> Array:
    """Hamilton product p ⊗ q. Shapes (..., 4), broadcast."""
    pw, px, py, pz = p[..., 0], p[..., 1], p[..., 2], p[..., 3]
    qw, qx, qy, qz = q[..., 0], q[..., 1], q[..., 2], q[..., 3]
    out = np.empty(np.broadcast_shapes(p.shape, q.shape))
    out[..., 0] = pw * qw - px * qx - py * qy - pz * qz
    out[..., 1] = pw * qx + px * qw + py * qz - pz * qy
    out[..., 2] = pw * qy - px * qz + py * qw + pz * qx
    out[..., 3] = pw * qz + px * qy - py * qx + pz * qw
    return out


def conjugate(q: Array) -> Array:
    """The inverse rotation of unit quaternions. Shape (..., 4)."""
    return q * np.array([1.0, -1.0, -1.0, -1.0])


def rotate(q_a_from_b: Array, v_b: Array) -> Array:
    """Vectors (..., 3) of b in the coordinates of a."""
    w, r = q_a_from_b[..., :1], q_a_from_b[..., 1:]
    t = 2.0 * np.cross(r, v_b)
    out: Array = v_b + w * t + np.cross(r, t)
    return out


def normalise(q: Array) -> Array:
    """Scaled to unit length. Shape (..., 4)."""
    out: Array = q / np.linalg.norm(q, axis=-1, keepdims=True)
    return out


def from_rotation_vector(v_rad: Array) -> Array:
    """exp(v / 2): the rotation by ‖v‖ about v. Shape (..., 3) in, (..., 4) out."""
    half = 0.5 * np.linalg.norm(v_rad, axis=-1, keepdims=True)
    # sin(x)/x is exact to rounding through numpy's sinc, also at 0
    return np.concatenate([np.cos(half), 0.5 * v_rad * np.sinc(half / np.pi)], axis=-1)


def to_rotation_vector(q: Array) -> Array:
    """The inverse of `from_rotation_vector`, of length at most π. Shape (..., 4) in, (..., 3) out."""
    q = np.where(q[..., :1] < 0.0, -q, q)
    sine = np.linalg.norm(q[..., 1:], axis=-1, keepdims=True)
    half = np.arctan2(sine, q[..., :1])
    out: Array = 2.0 * q[..., 1:] / np.sinc(half / np.pi)
    return out


def from_axis_angle(axis: ArrayLike, angle_rad: ArrayLike) -> Array:
    """Rotation by an angle about a unit axis; axes (..., 3) and angles (...) broadcast."""
    return from_rotation_vector(np.asarray(axis, float) * np.asarray(angle_rad, float)[..., None])


def to_matrix(q: Array) -> Array:
    """Rotation matrices (..., 3, 3), a from b."""
    w, x, y, z = np.moveaxis(q, -1, 0)
    m = np.empty((*q.shape[:-1], 3, 3))
    m[..., 0, 0] = 1 - 2 * (y * y + z * z)
    m[..., 0, 1] = 2 * (x * y - w * z)
    m[..., 0, 2] = 2 * (x * z + w * y)
    m[..., 1, 0] = 2 * (x * y + w * z)
    m[..., 1, 1] = 1 - 2 * (x * x + z * z)
    m[..., 1, 2] = 2 * (y * z - w * x)
    m[..., 2, 0] = 2 * (x * z - w * y)
    m[..., 2, 1] = 2 * (y * z + w * x)
    m[..., 2, 2] = 1 - 2 * (x * x + y * y)
    return m


def angle_between(p: Array, q: Array) -> Array:
    """The rotation angle from p to q, rad, in [0, π]. Shapes (..., 4) in, (...) out."""
    out: Array = np.linalg.norm(to_rotation_vector(multiply(conjugate(p), q)), axis=-1)
    return out
