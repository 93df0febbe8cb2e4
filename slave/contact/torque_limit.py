"""How hard each drive may turn now: what the motion needs by the robot's model, and a margin. Pure.

A position drive that is held up pushes harder and harder, up to its own limit. With this limit it never
pushes harder than moving or standing needs, without anything having to be noticed first. What standing needs
is always allowed: an arm that speeds up downwards needs next to nothing, but a drive whose slave dies then
must hold it with what it was told last.
"""

from __future__ import annotations

from collections import deque

import numpy as np

from common.quaternion import Array
from slave.contact.config import ContactConfig
from slave.contact.foretold import KEPT_S

MARGIN = 1.25
"""Thresholds: a drive at its limit pushes hard enough to be noticed."""


class TorqueLimit:
    """Limits J drives by what `ForetoldTorque` says that they need, over the last `KEPT_S`."""

    def __init__(self, config: ContactConfig) -> None:
        self._config = config
        self._allowed: deque[tuple[float, Array, Array]] = deque()
        """Age in s, least and greatest torque (J,), newest last."""

    def forget(self) -> None:
        """Nobody follows anybody: drives may give what they have."""
        self._allowed.clear()

    def step(self, dt_s: float, inertial_nm: Array, bias_nm: Array, floor_nm: Array) -> Array | None:
        """(2, J) least and greatest torque, N m at the joint, for the M q'' and C q' + g (J,) foretold now.

        `floor_nm` (J,): the thresholds of a robot whose motors do nothing. None where the limit is switched
        off.
        """
        if not self._config.torque_limit:
            return None
        margin = MARGIN * (floor_nm + self._config.model_error * (np.abs(inertial_nm) + np.abs(bias_nm)))
        needed = inertial_nm + bias_nm
        self._allowed = deque((age + dt_s, a, b) for age, a, b in self._allowed if age + dt_s <= KEPT_S)
        self._allowed.append(
            (0.0, np.minimum(needed, bias_nm) - margin, np.maximum(needed, bias_nm) + margin)
        )
        return np.stack(
            (
                np.min([a for _, a, _ in self._allowed], axis=0),
                np.max([b for _, _, b in self._allowed], axis=0),
            )
        )
