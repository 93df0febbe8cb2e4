"""The follower that suits a robot."""

from __future__ import annotations

from common.quaternion import Array
from common.reach.chains import ChainFollower
from common.reach.follower import PostureFollower
from common.skeleton import Skeleton

Follower = PostureFollower | ChainFollower


def make_follower(
    skeleton: Skeleton, lower_rad: Array, upper_rad: Array, *, spread: bool = False
) -> Follower:
    """Closed formulas where the robot's joints are the table's axes, else least squares.

    `spread`: no posture may take long, as in a control loop (`ChainFollower`).
    """
    if skeleton.plain:
        return PostureFollower(skeleton, lower_rad, upper_rad)
    return ChainFollower(skeleton, lower_rad, upper_rad, spread=spread)
