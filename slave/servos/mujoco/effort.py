"""The torque that each simulated motor gave its joint in the newest physics step."""

from __future__ import annotations

import mujoco
import numpy as np

from common.quaternion import Array
from common.skeleton import Skeleton
from slave.model.build import unit_rates
from slave.model.own import leader


class MotorTorque:
    """Reads torques from a running simulation: call `before` and `after` around each step.

    A real drive tells the mean over its cycle. MuJoCo's implicit integration gives a motor's damping for the
    velocity at the step's end, but writes down the one at its start: in a fling a quarter of the torque.
    """

    def __init__(self, skeleton: Skeleton, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        self._rates = unit_rates(skeleton, model)
        leaders = [leader(joint) for joint in skeleton.joints]
        self._hinges = np.array([model.joint(angle).dofadr[0] for angle, _ in leaders])
        self._joint_per_hinge = np.array([1.0 / ratio for _, ratio in leaders])
        self._model, self._joint_ids = model, model.dof_jntid[self._hinges]
        self._own_nm = model.jnt_actfrcrange[self._joint_ids].copy()
        """(J, 2) the motors' own limits at their hinges."""
        self._range_nm = self._own_nm
        self._damping = -model.actuator_biasprm[:, 2]
        # of a finger, the followers' share of gravity that is compensated is its motor's too
        self._carried = np.where(model.jnt_actgravcomp[model.dof_jntid], 0.0, 1.0)
        self._velocity, self._driven, self._lifted = data.qvel, data.qfrc_actuator, data.qfrc_gravcomp
        self._before = np.zeros(len(leaders))
        self.joint_nm: Array = np.zeros(len(leaders))
        """(J,) at the joint, N m, positive in the joint's positive direction."""

    def limit(self, joint_nm: Array | None) -> None:
        """Limit the motors to torques (2, J) at their joints, within their own limits; None: to those."""
        if joint_nm is None and self._range_nm is self._own_nm:
            return
        own = self._own_nm
        if joint_nm is not None:
            # a hinge that turns against its joint has the limits the other way round
            asked = np.sort((joint_nm * self._joint_per_hinge).T, axis=1)
            own = np.clip(asked, self._own_nm[:, :1], self._own_nm[:, 1:])
        self._range_nm = own
        self._model.jnt_actfrcrange[self._joint_ids] = own

    def before(self) -> None:
        """A step begins."""
        self._before = self._velocity[self._hinges]

    def after(self) -> None:
        """It has ended."""
        sped_up = (self._velocity[self._hinges] - self._before) * self._joint_per_hinge
        # a motor at its limit gives that, whatever the velocity
        driven = self._driven[self._hinges]
        free = (driven > self._range_nm[:, 0]) & (driven < self._range_nm[:, 1])
        written = self._rates @ (self._driven + self._carried * self._lifted)
        self.joint_nm = written - np.where(free, self._damping * sped_up, 0.0)
