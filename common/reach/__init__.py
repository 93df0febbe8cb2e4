"""Which postures a robot can take, and which of them is the nearest to the operator's."""

from common.reach.any_robot import Follower, make_follower
from common.reach.chains import ChainFollower
from common.reach.follower import NOMINAL_S, PostureFollower
from common.reach.nearest import nearest_angles

__all__ = ["NOMINAL_S", "ChainFollower", "Follower", "PostureFollower", "make_follower", "nearest_angles"]
