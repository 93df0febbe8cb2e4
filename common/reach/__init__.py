"""Which postures a robot can take, and which of them is the nearest to the operator's."""

from common.reach.nearest import nearest_angles
from common.reach.reach import NOMINAL_S, Reach

__all__ = ["NOMINAL_S", "Reach", "nearest_angles"]
