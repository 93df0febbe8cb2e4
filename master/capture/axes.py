"""Axes of a unit as a signed permutation, such as "y -x z": from the unit's frame into the sensor's. Pure."""

from __future__ import annotations

import numpy as np

from common.quaternion import Array, normalise

_LETTERS = "xyz"
WORLDS = {"enu": "x y z", "ned": "y x -z", "nwu": "-y x z"}
"""East, north and up of the worlds in use, each as an axis of that world."""


def permutation(text: str) -> Array:
    """(3, 3): row i picks the unit's axis that is the sensor's axis i. Raises ValueError.

    "y -x z": the sensor's x is the unit's y, its y the unit's -x, its z the unit's z.
    """
    words = text.split()
    names = [word.removeprefix("-") for word in words]
    if sorted(names) != list(_LETTERS):
        raise ValueError('three axes such as "y -x z", each of x, y and z once')
    matrix = np.zeros((3, 3))
    for row, (word, name) in enumerate(zip(words, names, strict=True)):
        matrix[row, _LETTERS.index(name)] = -1.0 if word.startswith("-") else 1.0
    return matrix


def is_left_handed(matrix: Array) -> bool:
    """Whether a signed permutation (3, 3) turns a right-handed frame into a left-handed one."""
    return bool(np.linalg.det(matrix) < 0.0)


def quaternion_of(matrix: Array) -> Array:
    """(4,) of a rotation matrix (3, 3) that is a signed permutation, or minus one."""
    rotation = matrix * np.sign(np.linalg.det(matrix))
    # the eigenvector of the largest eigenvalue (Bar-Itzhack 2000): right at every angle, 180° too
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = rotation
    k = np.array(
        [
            [xx + yy + zz, zy - yz, xz - zx, yx - xy],
            [zy - yz, xx - yy - zz, xy + yx, xz + zx],
            [xz - zx, xy + yx, yy - xx - zz, yz + zy],
            [yx - xy, xz + zx, yz + zy, zz - xx - yy],
        ]
    )
    _, vectors = np.linalg.eigh(k)
    return normalise(vectors[:, -1])
