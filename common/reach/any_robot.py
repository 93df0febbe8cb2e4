"""The follower that suits a robot."""

from __future__ import annotations

from common.quaternion import Array
from common.reach.chains import ChainFollower
from common.reach.follower import PostureFollower
from common.skeleton import Skeleton

Follower = PostureFollower | ChainFollower


def make_follower(skeleton: Skeleton, lower_rad: Array, upper_rad: Array) -> Follower:
    """Closed formulas where the robot's joints are the table's axes, else least squares."""
    kind = PostureFollower if skeleton.plain else ChainFollower
    return kind(skeleton, lower_rad, upper_rad)
