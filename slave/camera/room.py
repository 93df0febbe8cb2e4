"""What stands around the simulated robot, so that its operator sees it turn: a room with a bed and a table.

Only to look at: the physics knows nothing of it. World frame, metres; the robot looks along x.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

Triple = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Thing:
    """A box, or an upright cylinder of radius `half_m[0]` and half height `half_m[2]`."""

    at_m: Triple
    """Its middle."""
    half_m: Triple
    colour: Triple
    round: bool = False


_WALL, _SIDE, _WOOD, _LINEN = (0.80, 0.84, 0.82), (0.72, 0.78, 0.80), (0.55, 0.40, 0.26), (0.90, 0.92, 0.95)
ROOM = (
    Thing((3.0, 0.0, 1.3), (0.02, 3.0, 1.3), _WALL),
    Thing((-3.0, 0.0, 1.3), (0.02, 3.0, 1.3), _WALL),
    Thing((0.0, 3.0, 1.3), (3.0, 0.02, 1.3), _SIDE),
    Thing((0.0, -3.0, 1.3), (3.0, 0.02, 1.3), _SIDE),
    Thing((0.0, 0.0, 2.6), (3.0, 3.0, 0.02), (0.93, 0.93, 0.93)),
    # a window, a door
    Thing((2.97, 1.0, 1.5), (0.02, 0.7, 0.5), (0.55, 0.75, 0.95)),
    Thing((2.97, -1.8, 1.0), (0.02, 0.45, 1.0), _WOOD),
    # a bed with a pillow
    Thing((1.9, 0.6, 0.45), (0.5, 1.0, 0.08), _LINEN),
    Thing((1.9, 1.4, 0.58), (0.35, 0.18, 0.06), (0.75, 0.85, 0.95)),
    # a table with a bottle and a cup
    Thing((0.75, 0.0, 0.72), (0.25, 0.5, 0.02), _WOOD),
    Thing((0.65, -0.15, 0.84), (0.035, 0.035, 0.10), (0.15, 0.55, 0.30), round=True),
    Thing((0.65, 0.15, 0.79), (0.04, 0.04, 0.05), (0.85, 0.30, 0.20), round=True),
)


def furnish(scene: Any) -> None:
    """Add the room to a `mujoco.MjvScene` that has just been updated."""
    import mujoco

    upright = np.eye(3).ravel()
    for thing in ROOM:
        if scene.ngeom >= scene.maxgeom:
            return
        kind = mujoco.mjtGeom.mjGEOM_CYLINDER if thing.round else mujoco.mjtGeom.mjGEOM_BOX
        geom = scene.geoms[scene.ngeom]
        colour = np.array((*thing.colour, 1.0), np.float32)
        mujoco.mjv_initGeom(geom, kind, thing.half_m, thing.at_m, upright, colour)
        scene.ngeom += 1
