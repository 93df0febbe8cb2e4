"""Which postures a robot can take, and which of them is the nearest to the operator's."""

from common.reach.follower import NOMINAL_S, PostureFollower
from common.reach.nearest import nearest_angles

__all__ = ["NOMINAL_S", "PostureFollower", "nearest_angles"]
