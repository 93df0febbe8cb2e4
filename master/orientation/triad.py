"""A node's orientation from gravity and the magnetic field alone, at rest (paper C, section 4.2).

Low-passed acceleration gives the vertical, the field's horizontal part north, their cross product east. Two
nodes' orientations give the joint between them, which the solver takes apart into three anatomical angles.
No gyro is in it, so it holds only while the person hardly moves: it is the reference for the filters, which
hold always. Where the paper takes the field itself for an axis, which it is not being inclined, only its
horizontal part counts here.
"""

from __future__ import annotations

import numpy as np

from common.quaternion import Array, heading_turn, multiply, normalise, rotate


def q_from_gravity_and_field(acc_m_s2: Array, mag_ut: Array) -> Array:
    """Orientations (..., 4), world east-north-up from sensor, of readings at rest (..., 3).

    NaN for a field in line with the vertical or a reading of zero: there is no answer.
    """
    up = acc_m_s2 / np.linalg.norm(acc_m_s2, axis=-1, keepdims=True)
    q_upright = _upright(up)
    field = rotate(q_upright, mag_ut)
    horizontal = np.hypot(field[..., 0], field[..., 1])
    known = horizontal > 1e-9 * np.linalg.norm(field, axis=-1)
    # north is along y: so far must the field be turned about the vertical to lie there
    turn = np.where(known, np.arctan2(field[..., 0], field[..., 1]), np.nan)
    return multiply(heading_turn(turn), q_upright)


def _upright(up: Array) -> Array:
    """The smallest rotation (..., 4) that turns a unit vector (..., 3) to the vertical."""
    q = np.zeros((*up.shape[:-1], 4))
    q[..., 0], q[..., 1], q[..., 2] = 1.0 + up[..., 2], up[..., 1], -up[..., 0]
    # upside down every horizontal axis is as good as another
    q[np.linalg.norm(q, axis=-1) < 1e-9] = (0.0, 1.0, 0.0, 0.0)
    return normalise(q)
