"""A card with the time before the simulated camera's lens, as a screen stands before a real one.

It is part of the scene and shows the time at which the drawn posture was read: whoever reads it in the shown
picture knows how old that is, whatever stamps came with it (`common/picture_code`). Only to look at.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from common.picture_code.cells import COLUMNS, FRAME, MARGIN, ROWS, cells_of, count_of
from common.quaternion import Array

WIDTH_SHARE = 0.3
"""Of the picture's width, in its lower left corner."""
_WIDE, _HIGH = COLUMNS + 2 * (FRAME + MARGIN), ROWS + 2 * (FRAME + MARGIN)
_BLACK, _WHITE = (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)
_NEAR = 2.0
"""Distance of the card in distances of the nearest plane that is drawn."""
_LAYER = 0.01
"""Share of the distance by which one layer lies before the next."""

Patch = tuple[int, int, int, int]
"""First column, first row, columns, rows; in cells, counted from the card's upper left corner."""


def hold_card(scene: Any, time_ns: int, aspect: float) -> None:
    """Add the card to a `mujoco.MjvScene` that was just updated. `aspect`: the picture's width by height."""
    place = _Place(scene, aspect)
    edge = 2 * MARGIN
    place.add((0, 0, _WIDE, _HIGH), 0, _WHITE)
    place.add((MARGIN, MARGIN, _WIDE - edge, _HIGH - edge), 1, _BLACK)
    for patch in white_patches(time_ns):
        place.add(patch, 2, _WHITE)


def white_patches(time_ns: int) -> list[Patch]:
    """The white cells inside of the frame, those beside one another as one patch."""
    patches: list[Patch] = []
    for row, cells in enumerate(cells_of(count_of(time_ns))):
        edges = np.flatnonzero(np.diff(np.pad(cells.astype(np.int8), 1)))
        for begin, end in zip(edges[::2], edges[1::2], strict=True):
            inside = FRAME + MARGIN
            patches.append((inside + int(begin), inside + row, int(end - begin), 1))
    return patches


class _Place:
    """Where the card stands: before the camera that the scene was updated for."""

    def __init__(self, scene: Any, aspect: float) -> None:
        self._scene = scene
        eyes = scene.camera[0], scene.camera[1]
        self._eye: Array = 0.5 * (np.array(eyes[0].pos, dtype=np.float64) + np.array(eyes[1].pos))
        self._forward: Array = np.array(eyes[0].forward, dtype=np.float64)
        self._up: Array = np.array(eyes[0].up, dtype=np.float64)
        self._right: Array = np.cross(self._forward, self._up)
        self._away_m = _NEAR * float(eyes[0].frustum_near)
        self._half_high = float(eyes[0].frustum_top) / float(eyes[0].frustum_near)
        self._half_wide = self._half_high * aspect
        self._cell = 2 * self._half_wide * WIDTH_SHARE / _WIDE

    def add(self, patch: Patch, layer: int, colour: tuple[float, float, float]) -> None:
        """One thin box; where the scene is full, nothing."""
        import mujoco

        scene = self._scene
        if scene.ngeom >= scene.maxgeom:
            return
        away_m = self._away_m * (1.0 - _LAYER * layer)
        column, row, columns, rows = patch
        # sizes at a distance of 1 from the eye: so each layer covers the same pixels, whatever its distance
        right = -self._half_wide + (column + 0.5 * columns) * self._cell
        up = -self._half_high + (_HIGH - row - 0.5 * rows) * self._cell
        at_m = self._eye + away_m * (self._forward + right * self._right + up * self._up)
        half_m = np.array((columns * self._cell, rows * self._cell, 1e-4)) * (0.5 * away_m)
        turned = np.column_stack((self._right, self._up, -self._forward)).ravel()
        geom = scene.geoms[scene.ngeom]
        rgba = np.array((*colour, 1.0), np.float32)
        mujoco.mjv_initGeom(geom, mujoco.mjtGeom.mjGEOM_BOX, half_m, at_m, turned, rgba)
        geom.emission, geom.specular, geom.shininess = 1.0, 0.0, 0.0  # a screen shines by itself
        scene.ngeom += 1
