"""`[servos.joints]`: which backend drives which of the robot's joints. Pure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from fnmatch import fnmatchcase

from common.errors import NOT_SET, ConfigMistake
from common.skeleton import Skeleton
from slave.encoders.counts import EncoderConfig

KEY = "servos.joints"


def shares(joints: Mapping[str, Sequence[str]], skeleton: Skeleton) -> dict[str, tuple[str, ...]]:
    """Joints of each backend in the robot's order, from names and patterns such as `left_*`."""
    return {
        backend: tuple(
            name for name in skeleton.joint_names if any(fnmatchcase(name, pattern) for pattern in patterns)
        )
        for backend, patterns in joints.items()
    }


def share_mistakes(joints: Mapping[str, Sequence[str]], skeleton: Skeleton) -> list[ConfigMistake]:
    """Patterns without a joint, joints with two backends, and joints with none."""
    expected = f"a joint of the {skeleton.name} profile, or a pattern of some"
    mistakes = [
        ConfigMistake(f"{KEY}.{backend}", pattern, expected)
        for backend, patterns in joints.items()
        for pattern in patterns
        if not any(fnmatchcase(name, pattern) for name in skeleton.joint_names)
    ]
    holder: dict[str, str] = {}
    for backend, names in shares(joints, skeleton).items():
        for name in names:
            if name in holder:
                expected = f"joints of one backend each: {holder[name]} drives this one too"
                mistakes.append(ConfigMistake(f"{KEY}.{backend}", name, expected))
            holder.setdefault(name, backend)
    left = [name for name in skeleton.joint_names if name not in holder]
    if left:
        expected = f'a backend for each joint, or "absent" for one without a servo: {", ".join(left)}'
        mistakes.append(ConfigMistake(KEY, NOT_SET, expected))
    return mistakes


def part_of(
    skeleton: Skeleton, encoders: EncoderConfig, names: Sequence[str]
) -> tuple[Skeleton, EncoderConfig]:
    """The robot and its encoders with these joints alone; the others are rigid."""
    if tuple(names) == skeleton.joint_names:
        return skeleton, encoders
    own = replace(skeleton, joints=tuple(joint for joint in skeleton.joints if joint.name in names))
    zeros = {name: count for name, count in encoders.zero_counts.items() if name in names}
    turned = [name for name in encoders.reversed if name in names]
    return own, encoders.model_copy(update={"zero_counts": zeros, "reversed": turned})
