"""Where a robot's joints stand when it stands as the operator does in the zero pose: upright, arms hanging.

Looked for by least squares over an arm's joints: each limb's axis points down, a bent elbow brings the
forearm ahead, a gripper's jaws move sideways (the palm faces the thigh), a wrist that bends about one axis
does so as the operator's flexes, and joints stay where they were unless one of these needs them. What no
criterion decides stays 0, and all of it is to be confirmed.
"""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np

from common.quaternion import Array
from deploy.ops.profile.guess import Guess

_STARTS = 12
_BEYOND_RAD = 0.2
"""So far beyond its limits a joint may stand in the zero pose: some elbows never become quite straight."""
_AXIS_ALIGNED = 0.85
"""A hinge whose axis is so much along its limb (cosine) is the limb's axis."""
_BENT_RAD = 1.2
_STRAIGHT_RAD = 0.12
_ELBOW, _JAWS, _WRIST, _STAY = 0.7, 0.5, 0.3, 0.02
_DOWN, _AHEAD = np.array([0.0, 0.0, -1.0]), np.array([1.0, 0.0, 0.0])


def zero_pose(model: mujoco.MjModel, guessed: Guess) -> tuple[Array, dict[str, float]]:
    """Every hinge's place (njnt,), and by segment how far its limb's axis is from hanging down, rad."""
    place = np.clip(0.0, model.jnt_range[:, 0], model.jnt_range[:, 1])
    off: dict[str, float] = {}
    for side in ("left", "right"):
        parts = [p for p in ("upper_arm", "forearm", "hand") if f"{side}_{p}" in guessed.groups]
        groups = [guessed.groups[f"{side}_{p}"] for p in parts]
        if not groups:
            continue
        arm = _HangingArm(model, place, groups, guessed.grips.get(side, []))
        place = arm.solved()
        for part, down in zip(parts, arm.limbs(place), strict=True):
            off[f"{side}_{part}"] = float(np.arccos(np.clip(down @ _DOWN, -1.0, 1.0)))
    return place, off


class _HangingArm:
    """One arm, in some posture of the rest of the robot."""

    def __init__(
        self, model: mujoco.MjModel, place: Array, groups: Sequence[Sequence[int]], grips: Sequence[int]
    ) -> None:
        self._model, self._data = model, mujoco.MjData(model)
        self._place, self._groups, self._grips = place, groups, grips
        self._joints = [j for group in groups for j in group]
        self._tip = _tip(model, int(model.jnt_bodyid[self._joints[-1]]))
        low, high = model.jnt_range[self._joints].T
        self._low, self._high = low - _BEYOND_RAD, high + _BEYOND_RAD
        self._stay = np.clip(0.0, low, high)

    def solved(self) -> Array:
        """(njnt,) with this arm hanging as nearly as it can."""
        from scipy.optimize import least_squares

        random = np.random.default_rng(0)
        starts = [self._stay, *random.uniform(self._low, self._high, (_STARTS - 1, len(self._low)))]
        inside = (self._low + 1e-6, self._high - 1e-6)
        tried = [
            least_squares(self._misfit, np.clip(start, *inside), bounds=(self._low, self._high))
            for start in starts
        ]
        # the first of those that are as good: the nearest to where the joints stood
        best = min(run.cost for run in tried)
        good = next(run for run in tried if run.cost < best + 1e-3)
        out = self._place.copy()
        out[self._joints] = self._rounded(good.x)
        return out

    def _rounded(self, angles: Array) -> Array:
        """To 0.1°; near a right angle, or where the joint stood, to that: models are drawn so."""
        out = np.radians(np.round(np.degrees(angles), 1))
        for k, angle in enumerate(angles.tolist()):
            for straight in (float(self._stay[k]), 0.5 * np.pi * round(angle / (0.5 * np.pi))):
                if abs(angle - straight) < _STRAIGHT_RAD and self._low[k] <= straight <= self._high[k]:
                    out[k] = straight
        return out

    def limbs(self, place: Array) -> list[Array]:
        """Unit vectors (3,) along upper arm, forearm and hand, as many as there are."""
        model, data = self._model, self._data
        data.qpos[:] = place
        mujoco.mj_kinematics(model, data)
        firsts = [data.xanchor[group[0]] for group in self._groups[1:]]
        ends = [*firsts, self._end()]
        return [self._limb(group, end) for group, end in zip(self._groups, ends, strict=True)]

    def _end(self) -> Array:
        body, local = self._tip
        out: Array = self._data.xpos[body] + self._data.xmat[body].reshape(3, 3) @ local
        return out

    def _limb(self, group: Sequence[int], end: Array) -> Array:
        """The axis of the hinge that turns the limb about itself; without one, from start to end."""
        along = end - self._data.xanchor[group[0]]
        along = along / max(float(np.linalg.norm(along)), 1e-9)
        axis = self._data.xaxis[group[-1]]
        cosine = float(axis @ along)
        out: Array = axis * np.sign(cosine) if abs(cosine) > _AXIS_ALIGNED else along
        return out.copy()

    def _misfit(self, angles: Array) -> Array:
        place = self._place.copy()
        place[self._joints] = angles
        parts = [limb - _DOWN for limb in self.limbs(place)]
        parts += [_JAWS * self._data.xaxis[j][[0, 2]] for j in self._grips[:1] if self._slides(j)]
        if len(self._groups) > 2 and self._only_bends(self._groups[2]):
            parts.append(_WRIST * self._data.xaxis[self._groups[2][0]][[1, 2]])
        if len(self._groups) > 1:
            elbow = self._groups[1][0]
            low, high = self._model.jnt_range[elbow]
            place[elbow] += np.copysign(_BENT_RAD, 0.5 * (low + high) - place[elbow])
            forearm = self.limbs(place)[1]
            parts.append(_ELBOW * (forearm - np.cos(_BENT_RAD) * _DOWN - np.sin(_BENT_RAD) * _AHEAD))
        return np.concatenate([*parts, _STAY * (angles - self._stay)])

    def _only_bends(self, hand: Sequence[int]) -> bool:
        """Whether the hand bends about one axis alone: then about the one about which a person's flexes."""
        axes = self._data.xaxis
        return len(hand) == 1 or bool(abs(axes[hand[-1]] @ self._limb(hand, self._end())) > _AXIS_ALIGNED)

    def _slides(self, joint: int) -> bool:
        return bool(self._model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_SLIDE)


def _tip(model: mujoco.MjModel, hand: int) -> tuple[int, Array]:
    """The body beyond the hand's last hinge whose shape is farthest from it, and where in its frame."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    origin = data.xpos[hand]
    best, far = (hand, np.array([0.0, 0.0, 1e-3])), 0.0
    for g in range(model.ngeom):
        body = int(model.geom_bodyid[g])
        if body == hand or _hangs(model, body, hand):
            away = float(np.linalg.norm(data.geom_xpos[g] - origin))
            if away > far:
                local = data.xmat[body].reshape(3, 3).T @ (data.geom_xpos[g] - data.xpos[body])
                best, far = (body, local), away
    return best


def _hangs(model: mujoco.MjModel, body: int, above: int) -> bool:
    while body > above:
        body = int(model.body_parentid[body])
    return body == above
