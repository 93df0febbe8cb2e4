"""What a robot's state says of its joints' torques, by joint and in words. Pure."""

from __future__ import annotations

import math
from collections.abc import Mapping

from common.quaternion import Array
from common.skeleton import load_skeleton
from common.skeleton.load import profile_names

_LARGEST = 3
"""So many joints are named in a line."""

TorquesByJoint = dict[str, float | None]
"""N m, None where it is not known."""


def by_joint(torque_nm: Array | None) -> TorquesByJoint | None:
    """Torques (J,) under the joints' names, those of the profile that has as many; else under numbers."""
    if torque_nm is None:
        return None
    each = (load_skeleton(name).joint_names for name in profile_names())
    names = next((names for names in each if len(names) == len(torque_nm)), None)
    keys = names or [f"joint {j}" for j in range(len(torque_nm))]
    values = [None if math.isnan(nm) else round(nm, 3) for nm in torque_nm.tolist()]
    return dict(zip(keys, values, strict=True))


def largest(torques: Mapping[str, float | None], between: str = ", ") -> str:
    """The joints of the largest torques, with them; empty where none is known."""
    known = {name: nm for name, nm in torques.items() if nm is not None}
    first = sorted(known, key=lambda name: -abs(known[name]))[:_LARGEST]
    return between.join(f"{name} {known[name]:+.1f}" for name in first) + " N m" * bool(first)


def without_torque_limit(no_torque_limit: Mapping[str, str]) -> list[str]:
    """A line for each reason why the drives of some joints take no torque limit."""
    return [
        f"the drive{'s' * (len(joints) > 1)} of {', '.join(joints)} may push as hard as "
        f"{'they' if len(joints) > 1 else 'it'} can: {why}"
        for why, joints in _by_reason(no_torque_limit).items()
    ]


def without_detection(no_effort: Mapping[str, str]) -> list[str]:
    """A line for each reason why the efforts of some joints are not known."""
    return [
        f"no contact detection: {', '.join(joints)} tell{'s' * (len(joints) == 1)} no effort: {why}"
        for why, joints in _by_reason(no_effort).items()
    ]


def _by_reason(words: Mapping[str, str]) -> dict[str, list[str]]:
    reasons: dict[str, list[str]] = {}
    for joint, why in words.items():
        reasons.setdefault(why, []).append(joint)
    return reasons
