"""Quaternions, wxyz, vectorised over any leading axes; `q_a_from_b` rotates b's coordinates into a's."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

IDENTITY: Array = np.array([1.0, 0.0, 0.0, 0.0])
_CONJUGATE: Array = np.array([1.0, -1.0, -1.0, -1.0])


def _hamilton() -> Array:
    """The product's structure: (p outer q) flattened to 16, times this (16, 4), is p ⊗ q."""
    i, j, k = (0, 1), (0, 2), (0, 3)
    table = [
        [(0, 0), i, j, k],
        [i, (1, 0), k, (1, 2)],
        [j, (1, 3), (1, 0), i],
        [k, j, (1, 1), (1, 0)],
    ]
    structure = np.zeros((4, 4, 4))
    for p, row in enumerate(table):
        for q, (minus, unit) in enumerate(row):
            structure[p, q, unit] = -1.0 if minus else 1.0
    return structure.reshape(16, 4)


def _cross() -> Array:
    """The same for a × b: (a outer b) flattened to 9, times this (9, 3)."""
    return _hamilton().reshape(4, 4, 4)[1:, 1:, 1:].reshape(9, 3).copy()


_HAMILTON = _hamilton()
_CROSS = _cross()


def multiply(p: Array, q: Array) -> Array:
    """Hamilton product p ⊗ q. Shapes (..., 4), broadcast."""
    # one outer product and one matrix product: on a few dozen rows numpy's cost is its calls
    outer = p[..., :, None] * q[..., None, :]
    out: Array = outer.reshape(*outer.shape[:-2], 16) @ _HAMILTON
    return out


def cross(a: Array, b: Array) -> Array:
    """Vector product a × b. Shapes (..., 3), broadcast."""
    outer = a[..., :, None] * b[..., None, :]
    out: Array = outer.reshape(*outer.shape[:-2], 9) @ _CROSS
    return out


def conjugate(q: Array) -> Array:
    """The inverse rotation of unit quaternions. Shape (..., 4)."""
    return q * _CONJUGATE


def rotate(q_a_from_b: Array, v_b: Array) -> Array:
    """Vectors (..., 3) of b in the coordinates of a."""
    w, r = q_a_from_b[..., :1], q_a_from_b[..., 1:]
    t = 2.0 * cross(r, v_b)
    return v_b + w * t + cross(r, t)


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


def heading_turn(heading_rad: ArrayLike) -> Array:
    """Rotation about the vertical z; headings (...) in, (..., 4) out."""
    half = 0.5 * np.asarray(heading_rad, dtype=np.float64)
    out = np.zeros((*half.shape, 4))
    out[..., 0], out[..., 3] = np.cos(half), np.sin(half)
    return out


def heading_rad(q: Array) -> Array:
    """The heading whose `heading_turn` is nearest to q (its twist about z). Shape (..., 4) in, (...) out.

    0 where q turns the vertical upside down, so that no heading is nearest.
    """
    flip = np.where(q[..., 0] < 0.0, -1.0, 1.0)
    out: Array = 2.0 * np.arctan2(flip * q[..., 3], flip * q[..., 0])
    return out


def _squares() -> Array:
    """(q outer q) flattened to 16, times this (16, 9), is the rotation matrix flattened."""
    # R v is the vector part of q ⊗ v ⊗ q*: put the basis vectors through the product's structure
    left = _HAMILTON.reshape(4, 4, 4)
    turned = np.einsum("ajb,bcd,c->acdj", left[:, 1:], left, _CONJUGATE)[:, :, 1:]
    out: Array = turned.reshape(16, 9)
    return out


_SQUARES = _squares()


def to_matrix(q: Array) -> Array:
    """Rotation matrices (..., 3, 3), a from b, of unit quaternions (..., 4)."""
    outer = q[..., :, None] * q[..., None, :]
    out: Array = outer.reshape(*outer.shape[:-2], 16) @ _SQUARES
    return out.reshape(*outer.shape[:-2], 3, 3)


def angle_between(p: Array, q: Array) -> Array:
    """The rotation angle from p to q, rad, in [0, π]. Shapes (..., 4) in, (...) out."""
    out: Array = np.linalg.norm(to_rotation_vector(multiply(conjugate(p), q)), axis=-1)
    return out
