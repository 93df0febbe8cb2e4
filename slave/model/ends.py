"""The ends of the robot's limbs: what of it reaches farthest, and so moves fastest. Pure."""

from __future__ import annotations

from functools import lru_cache

import mujoco
import numpy as np
from numpy.typing import NDArray

from common.quaternion import Array
from common.skeleton import Skeleton
from slave.model.body import BodyModel
from slave.model.build import build_model, unit_rates
from slave.model.capsules import capsules, links

_ENDS = ("left_hand", "right_hand", "left_foot", "right_foot")


class LimbEnds:
    """The far end of each hand and foot that some joint moves; without them, of the last segments."""

    def __init__(self, skeleton: Skeleton) -> None:
        names = [link.name for link in links(skeleton)]
        followed = {segment.link or segment.name: segment.name for segment in skeleton.segments}
        body = BodyModel(skeleton)
        moved = (body.carries @ np.abs(body.hinges_per_joint).T) > 0.0
        parents = {link.parent for link in links(skeleton)}
        ends = [i for i, name in enumerate(names) if followed.get(name) in _ENDS and moved[i].any()]
        ends = ends or [i for i, name in enumerate(names) if name not in parents]
        self.names = tuple(followed.get(names[i], names[i]) for i in ends)
        self.moved_by: NDArray[np.bool_] = moved[ends]
        """(E, J): whether a joint moves the end."""
        self._local_m = np.array([_farthest_m(skeleton, i) for i in ends])[:, :, None]
        self._model = build_model(skeleton)
        self._data = mujoco.MjData(self._model)
        self._rates = unit_rates(skeleton, self._model)
        self._bodies = np.array([self._model.body(names[i]).id for i in ends])

    def at(self, position_rad: Array) -> Array:
        """(E, 3) m, base frame, for joint angles (J,)."""
        data = self._data
        data.qpos[:] = position_rad @ self._rates
        mujoco.mj_kinematics(self._model, data)
        turned = data.xmat[self._bodies].reshape(-1, 3, 3) @ self._local_m
        out: Array = data.xpos[self._bodies] + turned[:, :, 0]
        return out


def _farthest_m(skeleton: Skeleton, segment: int) -> Array:
    points = [np.array(capsule.to_m) for capsule in capsules(skeleton) if capsule.segment == segment]
    return max(points, key=lambda point: float(point @ point), default=np.zeros(3))


@lru_cache(maxsize=16)
def limb_ends(skeleton: Skeleton) -> LimbEnds:
    """The ends of a robot; building them takes some tens of ms."""
    return LimbEnds(skeleton)
