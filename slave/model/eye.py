"""The eye of a simulated robot: a camera in its head, where its model has a link of that name."""

from __future__ import annotations

import math

LINK = "head"
NAME = "head"
POSITION_M = (0.09, 0.0, 0.1)
"""In the head's frame: at the eyes, looking ahead."""
FIELD_DEG = 70.0
"""From the picture's lower to its upper edge."""
RIGHT, UP = (0.0, -1.0, 0.0), (0.0, 0.0, 1.0)
"""The picture's directions in the head's frame."""
Q_LINK_FROM_CAMERA = (0.5, -0.5, 0.5, -0.5)
"""The same: x right, y down, z ahead."""
FOCAL = 0.5 / math.tan(math.radians(0.5 * FIELD_DEG))
"""Over the picture's height."""
