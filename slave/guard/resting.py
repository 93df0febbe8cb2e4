"""Joint groups that the operator lets rest: they hold, and the others follow."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from common.skeleton import Skeleton
from common.skeleton.groups import joint_groups
from common.wire.messages import Mask


class RestingJoints:
    """Which groups rest. A hold, an engage or another operator changes nothing: only a take-up does.

    What the robot holds in a resting hand must not fall because somebody else engages.
    """

    def __init__(self, skeleton: Skeleton) -> None:
        self._groups = joint_groups(skeleton)
        self._of = skeleton.name
        self._resting: dict[str, Mask] = {}
        self.joints: Mask = np.zeros(len(skeleton.joints), np.bool_)
        """(J,) joints that rest."""

    @property
    def names(self) -> tuple[str, ...]:
        """Groups that rest, in the order in which they began."""
        return tuple(self._resting)

    @property
    def words(self) -> str:
        """What a person who engages must know; empty where nothing rests."""
        names = " ".join(self._resting)
        return f"; at rest: {names} (follow again: tandem take-up {names})" if names else ""

    def rest(self, names: Sequence[str]) -> str | None:
        """Let groups rest; or why not."""
        unknown = [name for name in names if name not in self._groups]
        if unknown or not names:
            asked = f"{', '.join(unknown)} is no joint group" if unknown else "name at least one joint group"
            return f"{asked}: {self._of} has {', '.join(self._groups)}"
        self._set({**self._resting, **{name: self._groups[name] for name in names}})
        return None

    def take_up(self, names: Sequence[str]) -> str | None:
        """End the rest of groups; or why not."""
        others = [name for name in names if name not in self._resting]
        if others or not names:
            return (
                f"at rest: {', '.join(self._resting) or 'no joint group'}, not {', '.join(others) or 'none'}"
            )
        self._set({name: joints for name, joints in self._resting.items() if name not in names})
        return None

    def _set(self, resting: dict[str, Mask]) -> None:
        self._resting = resting
        self.joints = np.logical_or.reduce([np.zeros_like(self.joints), *resting.values()])
